// A camera that reads its rows one after the other: a path is as true as by one that reads all at once, if
// its file says how long that takes.

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "dynamic_slam/diagnosis/self_calibration.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

constexpr int kFrames = 75;
constexpr double kReadout_s = 0.03;
constexpr int kBandRows = 12;  // read at once: a tenth of a pixel

Camera SmallCamera() {
  Camera camera = SmallRoom::SmallCamera();
  camera.fps = 30;
  return camera;
}

// The pose at a time between two of the truth.
Rigid3 PoseAt(const Trajectory& truth, double time_s) {
  size_t i = 0;
  while (i + 2 < truth.size() && truth[i + 1].timestamp_s <= time_s) ++i;
  const StampedPose &a = truth[i], &b = truth[i + 1];
  const double share = (time_s - a.timestamp_s) / (b.timestamp_s - a.timestamp_s);
  const Rigid3 &from = a.world_from_cam, &to = b.world_from_cam;
  return Rigid3(from.rotation.slerp(share, to.rotation),
                (1 - share) * from.translation + share * to.translation);
}

struct Film {
  Trajectory truth;
  std::vector<cv::Mat> images;
};

// Frames 2, 4, ... of a path at half of their stamps: twice as fast.
Film MakeFilm(double readout_s) {
  RoomOptions options = SmallRoom::Options();
  options.camera = SmallCamera();
  options.frames = 2 * kFrames + 4;
  const Room room(options);
  Film film;
  for (int i = 1; i <= kFrames; ++i) {
    const double middle_s = room.truth()[static_cast<size_t>(2 * i)].timestamp_s;
    cv::Mat image(options.camera.height, options.camera.width, CV_8UC1);
    for (int row = 0; row < image.rows; row += kBandRows) {
      const double share = (row + 0.5 * (kBandRows - 1)) / (image.rows - 1) - 0.5;
      const cv::Rect band(0, row, image.cols, kBandRows);
      room.Render(PoseAt(room.truth(), middle_s + 2 * readout_s * share))(band).copyTo(image(band));
    }
    film.images.push_back(image);
    film.truth.push_back(room.truth()[static_cast<size_t>(2 * i)]);
    film.truth.back().timestamp_s = (i - 1) / 30.0;
  }
  return film;
}

double ErrorOf(const Film& film, double readout_s) {
  Camera camera = SmallCamera();
  camera.readout_s = readout_s;
  ImageSource source(film.images);
  const WholeRun run = RunAll(source, camera);
  EXPECT_GT(run.system->FrameTrajectory().size(), 0.9 * kFrames) << readout_s;
  return ApeRmse(film.truth, run.system->FrameTrajectory());
}

const Film& RollingFilm() {
  static const Film& film = *new Film(MakeFilm(kReadout_s));
  return film;
}

const Film& GlobalFilm() {
  static const Film& film = *new Film(MakeFilm(0));
  return film;
}

TEST(RollingShutterRun, ItsReadoutIsFound) {
  const auto calibrate = [](const Film& film) {
    ImageSource source(film.images);
    return CalibrateByMap(SmallCamera(), &source);
  };
  const std::optional<SelfCalibration> rolling = calibrate(RollingFilm()), global = calibrate(GlobalFilm());
  ASSERT_TRUE(rolling.has_value() && global.has_value());
  EXPECT_NEAR(rolling->readout_s, kReadout_s, 0.15 * kReadout_s);
  EXPECT_GT(rolling->readout_gain, 0.05);
  EXPECT_LT(global->readout_s, 0.15 * kReadout_s);
  EXPECT_LT(global->readout_gain, 0.03);
}

TEST(RollingShutterRun, APathIsAsTrueAsThatOfAGlobalShutter) {
  const double known = ErrorOf(RollingFilm(), kReadout_s), unknown = ErrorOf(RollingFilm(), 0);
  const double ideal = ErrorOf(GlobalFilm(), 0);
  RecordProperty("known_m", std::to_string(known));
  RecordProperty("unknown_m", std::to_string(unknown));
  RecordProperty("ideal_m", std::to_string(ideal));
  EXPECT_LT(known, 0.5 * unknown);
  EXPECT_LT(known, 2 * ideal + 0.001);
}

}  // namespace
}  // namespace dynamic_slam
