#include "dynamic_slam/sim/sequence_writer.h"

#include <fstream>
#include <string>
#include <system_error>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

InputError CannotWrite(const std::filesystem::path& file) {
  return InputError(file.string(), "cannot be written", "Check the folder's permissions and the space left.");
}

}  // namespace

void WriteTumSequence(const Room& room, const std::filesystem::path& folder,
                      const std::function<void(int)>& on_frame) {
  std::error_code error;
  std::filesystem::create_directories(folder / "rgb", error);
  if (error) throw CannotWrite(folder / "rgb");
  std::string list = "# rendered images\n# timestamp filename\n";
  for (int i = 0; i < room.options().frames; ++i) {
    const std::string stamp = fmt::format("{:.6f}", room.truth()[i].timestamp_s);
    const std::string name = "rgb/" + stamp + ".jpg";
    if (!cv::imwrite((folder / name).string(), room.Frame(i), {cv::IMWRITE_JPEG_QUALITY, 95})) {
      throw CannotWrite(folder / name);
    }
    list += stamp + " " + name + "\n";
    if (on_frame) on_frame(i + 1);
  }
  WriteTumTrajectory(folder / "groundtruth.txt", room.truth());
  WriteCamera(folder / "camera.yaml", room.options().camera);
  std::ofstream file(folder / "rgb.txt");
  file << list;
  file.close();
  if (!file) throw CannotWrite(folder / "rgb.txt");
}

}  // namespace dynamic_slam
