#include "render_sequence.h"

#include <functional>

#include <fmt/core.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/pose_list.h"
#include "dynamic_slam/sim/sequence_writer.h"
#include "dynamic_slam/sim/simulation_writer.h"

namespace dynamic_slam {

void CheckHoldsNoSequence(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "rgb.txt")) return;
  throw InputError(folder.string(), "holds a sequence already",
                   "Give another --out, or --force to replace it.");
}

namespace {

std::function<void(int)> ShowProgress(int frames_total) {
  if (isatty(STDERR_FILENO) == 0) return [](int) {};
  return
      [frames_total](int frames) { fmt::print(stderr, "\rrendered {} of {} frames", frames, frames_total); };
}

void PrintSequence(const std::filesystem::path& folder, const Trajectory& truth, uint64_t seed) {
  if (isatty(STDERR_FILENO) != 0) fmt::print(stderr, "\n");
  fmt::print("{}: {} frames, path {:.2f} m, seed {}\n", folder.string(), truth.size(),
             PathLength(ToPoseList(truth)), seed);
}

}  // namespace

void RenderRoom(const Room& room, const std::filesystem::path& folder) {
  WriteTumSequence(room, folder, ShowProgress(room.options().frames));
  PrintSequence(folder, room.truth(), room.options().seed);
}

void RenderScene(const SceneOptions& options, const std::filesystem::path& folder, bool with_depth) {
  const Simulation simulation(options);
  WriteSimulation(simulation, folder, with_depth, ShowProgress(options.frames));
  PrintSequence(folder, simulation.truth(), options.seed);
}

}  // namespace dynamic_slam
