// A bag of a sequence: its images as they are stored, and its camera.

#include <filesystem>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <rosbag/bag.h>

#include "conversions.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/frame_source.h"
#include "program.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string source, bag, camera, topic = "/camera/image_raw", frame = "camera_optical";
  FrameSourceOptions source_options;
  bool raw = false;
};

Camera ChooseCamera(const Arguments& arguments, const FrameSource& source) {
  if (!arguments.camera.empty()) return LoadCamera(arguments.camera);
  if (const std::optional<Camera> own = source.OwnCamera()) return *own;
  throw InputError(arguments.source, "has no camera file of its own", "Give one with --camera.");
}

// The bytes of the file that the image was read from, or a PNG where there is none.
sensor_msgs::CompressedImage Compressed(const fs::path& folder, const SourceImage& image,
                                        const std_msgs::Header& header) {
  sensor_msgs::CompressedImage message;
  message.header = header;
  const fs::path file = folder / image.name;
  const std::string extension = file.extension().string();
  std::error_code ignored;
  if ((extension == ".jpg" || extension == ".png") && fs::is_regular_file(file, ignored)) {
    const std::string bytes = ReadFile(file);
    message.data.assign(bytes.begin(), bytes.end());
    message.format = extension == ".jpg" ? "jpeg" : "png";
  } else {
    cv::imencode(".png", image.image, message.data);
    message.format = "png";
  }
  return message;
}

// What ROS calls images with these channels: grey or in colour.
sensor_msgs::Image Raw(const SourceImage& image, const std_msgs::Header& header) {
  if (image.image.type() != CV_8UC1 && image.image.type() != CV_8UC3) {
    throw InputError(image.name, "is not of 8 bits, grey or in colour", "Leave out --raw.");
  }
  return MessageFromImage(image.image, header);
}

int Run(const Arguments& arguments) {
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, arguments.source_options);
  const Camera camera = ChooseCamera(arguments, *source);
  CheckCameraFits(camera, arguments.camera.empty() ? arguments.source : arguments.camera,
                  source->ImageSize());
  CheckCanBeWritten(arguments.bag);
  const std::string camera_topic = (fs::path(arguments.topic).parent_path() / "camera_info").string();
  size_t count = 0;
  try {
    rosbag::Bag bag(arguments.bag, rosbag::bagmode::Write);
    while (const std::optional<SourceImage> image = source->Next()) {
      std_msgs::Header header;
      header.seq = static_cast<uint32_t>(count++);
      header.frame_id = arguments.frame;
      header.stamp = StampFromSeconds(image->timestamp_s);
      // The time of a message must not be 0, the stamp of a video's first image.
      const ros::Time time = std::max(header.stamp, ros::TIME_MIN);
      sensor_msgs::CameraInfo info = MessageFromCamera(camera);
      info.header = header;
      bag.write(camera_topic, time, info);
      if (arguments.raw) {
        bag.write(arguments.topic, time, Raw(*image, header));
      } else {
        bag.write(arguments.topic + "/compressed", time, Compressed(arguments.source, *image, header));
      }
    }
    bag.close();
  } catch (const rosbag::BagException& error) {
    throw InputError(arguments.bag, fmt::format("cannot be written: {}", error.what()), "");
  }
  for (const SourceProblem& problem : source->Problems())
    fmt::print("skipped {}: {}\n", problem.name, problem.reason);
  fmt::print("{} images on {}{}, camera on {}\n", count, arguments.topic, arguments.raw ? "" : "/compressed",
             camera_topic);
  return 0;
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  CLI::App app("A bag of a sequence: its images as they are stored, and its camera", "make_bag");
  dynamic_slam::Arguments a;
  app.add_option("SOURCE", a.source,
                 "Folder in TUM RGB-D, KITTI odometry or EuRoC layout, folder of images, or video file")
      ->required();
  app.add_option("BAG", a.bag, "The bag")->required();
  app.add_option("--camera", a.camera, "Name of a known camera, or camera file (default: what SOURCE says)");
  app.add_option("--topic", a.topic, "Topic of the images; the camera's is camera_info beside it")
      ->capture_default_str();
  app.add_option("--frame", a.frame, "Name of the camera's optical frame")->capture_default_str();
  app.add_flag("--raw", a.raw, "Decoded images (sensor_msgs/Image) instead of those in TOPIC/compressed");
  app.add_option("--start", a.source_options.start, "Frames to skip first")->check(CLI::NonNegativeNumber);
  app.add_option("--max-frames", a.source_options.max_frames, "Frames to read at most (0: all)")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--fps", a.source_options.fps, "Frames a second of a folder of images (30) or a video")
      ->check(CLI::NonNegativeNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return dynamic_slam::RunProgram([&a] { return Run(a); });
}
