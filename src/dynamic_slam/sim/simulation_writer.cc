#include "dynamic_slam/sim/simulation_writer.h"

#include <algorithm>
#include <atomic>
#include <system_error>

#include <fmt/core.h>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

InputError CannotWrite(const fs::path& file) {
  return InputError(file.string(), "cannot be written", "Check the folder's permissions and the space left.");
}

// Of the 16 bits of a depth image: TUM's indoors, KITTI's where one sees farther than 13 m.
double DepthUnitsPerMetre(const SceneOptions& options) { return options.world.kind == "office" ? 5000 : 256; }

struct Writer {
  const Simulation& simulation;
  const fs::path& folder;
  bool with_depth;

  std::string Stamp(int index) const { return fmt::format("{:.6f}", simulation.truth()[index].timestamp_s); }

  // Writes the images of a frame and returns its lines of boxes.csv; nothing when a file could not be
  // written.
  std::optional<std::string> WriteFrame(int index) const {
    const SimulatedFrame frame = simulation.Frame(index);
    const std::string stamp = Stamp(index);
    const auto write = [&](const char* kind, const char* type, const cv::Mat& image,
                           const std::vector<int>& settings) {
      return cv::imwrite((folder / kind / (stamp + type)).string(), image, settings);
    };
    bool good = write("rgb", ".jpg", frame.image,
                      {cv::IMWRITE_JPEG_QUALITY, simulation.options().effects.jpeg_quality});
    good = write("masks", ".png", frame.moving, {cv::IMWRITE_PNG_COMPRESSION, 1}) && good;
    if (with_depth) {
      cv::Mat depth;
      frame.depth_m.convertTo(depth, CV_16U, DepthUnitsPerMetre(simulation.options()));
      depth.setTo(0, depth == 65535);
      good = write("depth", ".png", depth, {cv::IMWRITE_PNG_COMPRESSION, 1}) && good;
    }
    if (!good) return std::nullopt;
    std::string lines;
    for (const TrueBox& box : frame.boxes) {
      const SceneObject& object = simulation.world().objects[box.actor];
      lines +=
          fmt::format("{},{},{},{:.0f},{:.0f},{:.0f},{:.0f},{:.3f},{}\n", stamp, box.actor, object.class_name,
                      box.box.x, box.box.y, box.box.width, box.box.height, box.visible, object.moves ? 1 : 0);
    }
    return lines;
  }
};

}  // namespace

void WriteSimulation(const Simulation& simulation, const fs::path& folder, bool with_depth,
                     const std::function<void(int)>& on_frame) {
  std::vector<const char*> kinds = {"rgb", "masks"};
  if (with_depth) kinds.push_back("depth");
  for (const char* kind : kinds) {
    std::error_code error;
    fs::create_directories(folder / kind, error);
    if (error) throw CannotWrite(folder / kind);
  }
  const Writer writer{simulation, folder, with_depth};
  std::vector<int> frames;
  for (int i = 0; i < simulation.options().frames; ++i) {
    if (!simulation.IsDropped(i)) frames.push_back(i);
  }
  std::string images = "# rendered images\n# timestamp filename\n",
              boxes = "timestamp,actor,class,x,y,w,h,visible,moving\n";
  std::string depths =
      fmt::format("# depth along the optical axis, {} units a metre, 0: none\n# timestamp filename\n",
                  DepthUnitsPerMetre(simulation.options()));
  const size_t batch = 4 * static_cast<size_t>(std::max(1, cv::getNumThreads()));
  for (size_t first = 0; first < frames.size(); first += batch) {
    const size_t count = std::min(batch, frames.size() - first);
    std::vector<std::optional<std::string>> lines(count);
    cv::parallel_for_(
        cv::Range(0, static_cast<int>(count)),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) lines[i] = writer.WriteFrame(frames[first + i]);
        },
        static_cast<double>(count));
    for (size_t i = 0; i < count; ++i) {
      const std::string stamp = writer.Stamp(frames[first + i]);
      if (!lines[i]) throw CannotWrite(folder / "rgb" / (stamp + ".jpg"));
      boxes += *lines[i];
      images += stamp + " rgb/" + stamp + ".jpg\n";
      depths += stamp + " depth/" + stamp + ".png\n";
    }
    if (on_frame) on_frame(static_cast<int>(first + count));
  }
  WriteTumTrajectory(folder / "groundtruth.txt", simulation.truth());
  WriteCamera(folder / "camera.yaml", simulation.camera());
  WriteFileAtomically(folder / "scene.yaml", OptionsToYaml(simulation.options()));
  WriteFileAtomically(folder / "boxes.csv", boxes);
  if (with_depth) WriteFileAtomically(folder / "depth.txt", depths);
  WriteFileAtomically(folder / "rgb.txt", images);
}

}  // namespace dynamic_slam
