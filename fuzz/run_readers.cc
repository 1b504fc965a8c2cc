// What a run reads and leaves: sequences, maps, journals.

#include <cmath>
#include <limits>

#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/system/run_journal.h"
#include "readers.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// Images 0.pgm to 3.pgm, made once.
void MakeImages(const fs::path& folder) {
  if (fs::exists(folder)) return;
  fs::create_directories(folder);
  const std::string header = "P5\n16 16\n255\n";
  for (int i = 0; i < 4; ++i) Put(folder / (std::to_string(i) + ".pgm"), header + std::string(256, 'x'));
}

// Whatever the lists say, images come in the order of their stamps, and each that does not come is named.
void ReadSequence(const fs::path& folder) {
  std::unique_ptr<FrameSource> source;
  if (!IsTaken(folder.string(), [&] { source = OpenFrameSource(folder); })) return;
  IsTaken(folder.string(), [&] { source->OwnCamera(); });
  double last_s = -std::numeric_limits<double>::infinity();
  size_t frames = 0;
  while (const auto image = source->Next()) {
    DS_CHECK(std::isfinite(image->timestamp_s) && image->timestamp_s > last_s, "{} after {}",
             image->timestamp_s, last_s);
    DS_CHECK(image->image.size() == source->ImageSize(), "{}", image->name);
    last_s = image->timestamp_s;
    ++frames;
  }
  DS_CHECK(frames + source->Problems().size() == source->FrameCount(), "{} and {} of {}", frames,
           source->Problems().size(), source->FrameCount());
}

}  // namespace

void ReadTumSequence(std::string_view bytes, const fs::path& folder) {
  MakeImages(folder / "rgb");
  Put(folder / "rgb.txt", bytes);
  ReadSequence(folder);
}

// The input is times.txt and calib.txt at once.
void ReadKittiSequence(std::string_view bytes, const fs::path& folder) {
  MakeImages(folder / "image_0");
  Put(folder / "times.txt", bytes);
  Put(folder / "calib.txt", bytes);
  ReadSequence(folder);
}

void ReadEurocSequence(std::string_view bytes, const fs::path& folder) {
  MakeImages(folder / "mav0/cam0/data");
  Put(folder / "mav0/cam0/data.csv", bytes);
  Put(folder / "mav0/cam0/sensor.yaml", bytes);
  ReadSequence(folder);
}

// The input is what follows a header, which is made to fit it: the checksum guards nothing here.
void ReadMapBytes(std::string_view bytes, const fs::path&) {
  IsTaken("input: ", [&] {
    const SavedMap saved = DecodeMap(WithMapHeader(bytes), "input");
    const auto problems = saved.map.Validate();
    DS_CHECK(problems.empty(), "accepted, but {}", problems.front());
    const std::string again = EncodeMap(saved.camera, saved.map);
    DS_CHECK(EncodeMap(saved.camera, DecodeMap(again, "input").map) == again, "another map when saved again");
  });
}

void ReadRunJournal(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / RunJournal::kFileName, bytes);
  IsTaken(file.string(), [&] {
    const RecoveredRun run = ReadJournal(folder);
    size_t poses = 0;
    for (const Trajectory& trajectory : run.trajectories) {
      poses += trajectory.size();
      for (const StampedPose& pose : trajectory) {
        DS_CHECK(std::isfinite(pose.timestamp_s) && pose.world_from_cam.translation.allFinite(), "");
      }
    }
    DS_CHECK(poses <= run.frames, "{} poses of {} frames", poses, run.frames);
  });
}

}  // namespace dynamic_slam
