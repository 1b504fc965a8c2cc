// Films from which no map, or only a doubtful one, can be made: each frame ends in a state with a reason, and
// no number of the results is anything but finite.

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/semantics/replay_detector.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int kFrames = 30;

struct Film {
  std::string name;
  std::string reason;  // why no map is made of it; empty: one may be made
  std::function<cv::Mat(int frame)> image;
};

cv::Mat WithNoise(cv::Mat image, int frame) {
  Random random(static_cast<uint64_t>(frame) + 1);
  for (auto pixel = image.begin<uint8_t>(); pixel != image.end<uint8_t>(); ++pixel) {
    *pixel = cv::saturate_cast<uint8_t>(*pixel + 1.5 * random.Gaussian());
  }
  return image;
}

// A wall of 8 x 6 m, 2 m before a camera at the origin.
Scene Wall(const cv::Mat& texture, double z_m = 2) {
  Scene scene;
  scene.quads.push_back({{-4, -3, z_m}, {8, 0, 0}, {0, 6, 0}, std::make_shared<Texture>(texture)});
  return scene;
}

// The camera goes to the right, and sways.
Rigid3 Walk(int frame) {
  const double x_m = 0.03 * frame;
  return {ExpSo3({0.02 * std::sin(0.3 * frame), 0.03 * std::sin(0.2 * frame), 0}),
          {x_m - 0.6, 0.05 * std::sin(0.3 * frame), 0.1 * std::sin(0.15 * frame)}};
}

cv::Mat Tiles() {
  cv::Mat tile(32, 32, CV_8UC1, cv::Scalar(90)), tiles;
  cv::circle(tile, {12, 15}, 6, cv::Scalar(200), cv::FILLED);
  cv::rectangle(tile, {20, 4}, {27, 11}, cv::Scalar(20), cv::FILLED);
  cv::repeat(tile, 32, 42, tiles);  // one each 19 cm
  return tiles;
}

Film Rotation() {
  return {"rotation", "parallax", [](int frame) {
            const Room& room = SmallRoom::Get().room;
            const Rigid3& start = room.truth()[SmallRoom::kFrames - 1].world_from_cam;
            const Eigen::Vector3d turn(0.05 * std::sin(0.4 * frame), 0.02 * frame, 0);
            return WithNoise(
                room.Render({start.rotation * Eigen::Quaterniond(ExpSo3(turn)), start.translation}), frame);
          }};
}

Film OfWall(const std::string& name, const std::string& reason, const cv::Mat& texture) {
  return {name, reason, [scene = Wall(texture)](int frame) {
            static const Renderer renderer(SmallRoom::SmallCamera());
            return WithNoise(renderer.Render(scene, Walk(frame)), frame);
          }};
}

// A poster that is carried before the camera, close enough to hide all else.
Film Mover() {
  return {
      "mover", "", [poster = MakeRichTexture(5, 2, 2, 320)](int frame) {
        static const Renderer renderer(SmallRoom::SmallCamera());
        Scene scene;
        const Eigen::Vector3d corner(-1 - 0.02 * frame, -1 + 0.1 * std::sin(0.3 * frame), 0.7);
        scene.quads.push_back({corner, {2, 0.02 * frame, 0.3}, {0, 2, 0}, std::make_shared<Texture>(poster)});
        return WithNoise(renderer.Render(scene, {}), frame);
      }};
}

std::vector<cv::Mat> Images(const Film& film) {
  std::vector<cv::Mat> images;
  for (int i = 0; i < kFrames; ++i) images.push_back(film.image(i));
  return images;
}

WholeRun RunFilm(std::vector<cv::Mat> images, std::shared_ptr<Detector> detector = nullptr) {
  WholeRun run;
  ImageSource source(std::move(images));
  run.system = std::make_unique<SlamSystem>(SmallRoom::SmallCamera(), SmallRoom::CheapOptions());
  if (detector != nullptr) run.system->SetDetector(detector);
  run.summary = RunSequence(source, *run.system);
  return run;
}

std::vector<Film> Films() {
  return {Rotation(),
          OfWall("plane", "", MakeRichTexture(3, 8, 6, 128)),
          OfWall("no_texture", "texture", cv::Mat(64, 64, CV_8UC1, cv::Scalar(128))),
          OfWall("repeated_texture", "matches", Tiles()),
          Mover(),
          {"noise", "matches", SmallRoom::NoiseImage}};
}

class DegenerateTest : public FolderTest {
 protected:
  void ExpectSound(const WholeRun& run, size_t frames) {
    ASSERT_EQ(run.summary.failure, nullptr) << FailureMessage(run.summary);
    ASSERT_EQ(run.summary.frames.size(), frames);
    for (size_t i = 0; i < frames; ++i) {
      if (run.summary.frames[i].state != TrackingState::kTracking) {
        EXPECT_THAT(run.summary.ReasonOf(i), Not(IsEmpty())) << i;
      }
    }
    for (const PartId part : run.system->Parts()) {
      for (const StampedPose& pose : run.system->FrameTrajectory(part)) {
        EXPECT_TRUE(pose.world_from_cam.translation.allFinite());
        EXPECT_NEAR(pose.world_from_cam.rotation.norm(), 1, 1e-6);
      }
    }
    const auto map = run.system->map().Read();
    map->landmarks().ForEach([](const Landmark& landmark) { EXPECT_TRUE(landmark.position().allFinite()); });
    EXPECT_THAT(map->Validate(), IsEmpty());
  }

  void ExpectSoundFiles(const WholeRun& run) {
    WriteResults(folder_, *run.system, run.summary);
    for (const char* name : {"trajectory.txt", "keyframes.txt", "map.ply", "frames.csv", "loops.csv"}) {
      EXPECT_THAT(ReadFile(folder_ / name), Not(HasSubstr("nan"))) << name;
    }
  }
};

TEST_F(DegenerateTest, FromTheStart) {
  for (const Film& film : Films()) {
    SCOPED_TRACE(film.name);
    const WholeRun run = RunFilm(Images(film));
    ExpectSound(run, kFrames);
    ExpectSoundFiles(run);
    if (!film.reason.empty()) {
      EXPECT_EQ(run.summary.frames_tracked, 0u);
      EXPECT_THAT(run.summary.last_reason, HasSubstr(film.reason));
    }
  }
}

TEST_F(DegenerateTest, APlaneIsEnoughForAPath) {
  const WholeRun run = RunFilm(Images(OfWall("plane", "", MakeRichTexture(3, 8, 6, 128))));
  Trajectory truth;
  for (int i = 0; i < kFrames; ++i) truth.push_back({i / 30.0, Walk(i)});
  EXPECT_GE(run.summary.frames_tracked, 15u);
  EXPECT_LE(ApeRmse(truth, run.system->FrameTrajectory()), 0.01 * PathLength(ToPoseList(truth)));
}

TEST_F(DegenerateTest, WhileTracking) {
  const SmallRoom& room = SmallRoom::Get();
  for (const Film& film : Films()) {
    SCOPED_TRACE(film.name);
    std::vector<cv::Mat> images = room.images;
    for (cv::Mat& image : Images(film)) images.push_back(image);
    const size_t frames = images.size();
    const WholeRun run = RunFilm(std::move(images));
    ASSERT_EQ(run.summary.frames[SmallRoom::kFrames - 1].state, TrackingState::kTracking);
    ExpectSound(run, frames);
    ExpectSoundFiles(run);
  }
}

// Where nothing is to be seen there is nothing to start from.
TEST_F(DegenerateTest, TwoLostImagesAreFollowedByANewStartButDarkOnesAreWaitedFor) {
  std::vector<cv::Mat> images = SmallRoom::Get().images;
  const size_t dark = images.size(), lost = dark + 4;
  images.insert(images.end(), 4, SmallRoom::BlackImage());
  for (int i = 0; i < 3; ++i) images.push_back(SmallRoom::NoiseImage(i));
  const WholeRun run = RunFilm(std::move(images));
  const RunSummary& summary = run.summary;
  ASSERT_EQ(summary.frames[dark - 1].state, TrackingState::kTracking);
  for (size_t i = dark; i <= lost; ++i) EXPECT_EQ(summary.frames[i].state, TrackingState::kLost) << i;
  EXPECT_EQ(summary.frames[lost + 1].state, TrackingState::kInitialising);
  EXPECT_THAT(summary.ReasonOf(lost + 1), HasSubstr("starting again: lost for 2 frames"));
  EXPECT_EQ(summary.frames[lost + 2].state, TrackingState::kInitialising);
}

TEST_F(DegenerateTest, AMoverThatFillsTheViewMakesNoMap) {
  std::vector<DetectionSet> sets;
  for (int i = 0; i < kFrames; ++i) sets.push_back({FrameId(0), i / 30.0, {{{0, 0, 320, 240}, 0, 0.9}}});
  const WholeRun run = RunFilm(Images(Mover()), MakeReplayDetector("boxes", sets, {"person"}));
  ExpectSound(run, kFrames);
  EXPECT_FALSE(run.summary.initialised_at.has_value());
  EXPECT_THAT(run.summary.last_reason, HasSubstr("matches"));
}

}  // namespace
}  // namespace dynamic_slam
