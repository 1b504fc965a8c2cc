#include "render_room.h"

#include <fmt/core.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/pose_list.h"
#include "dynamic_slam/sim/sequence_writer.h"

namespace dynamic_slam {

void CheckHoldsNoSequence(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "rgb.txt")) return;
  throw InputError(folder.string(), "holds a sequence already",
                   "Give another --out, or --force to replace it.");
}

void RenderRoom(const Room& room, const std::filesystem::path& folder) {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  WriteTumSequence(room, folder, [&](int frames) {
    if (terminal) fmt::print(stderr, "\rrendered {} of {} frames", frames, room.options().frames);
  });
  if (terminal) fmt::print(stderr, "\n");
  fmt::print("{}: {} frames, path {:.2f} m, seed {}\n", folder.string(), room.truth().size(),
             PathLength(ToPoseList(room.truth())), room.options().seed);
}

}  // namespace dynamic_slam
