#include "dynamic_slam/tracking/past_views.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/semantics/compensation_test_scene.h"

namespace dynamic_slam {
namespace {

constexpr double kDepth = 3;           // of the wall, m
constexpr double kCameraStep = 0.004;  // to the right, m a frame: the wall moves by 0.67 px to the left
constexpr double kPersonStep_px = 2;   // to the right: less than the noise of corners tells in one frame
constexpr int kFrames = 6;             // the last one asks the oldest view

// A camera that moves slowly past a wall, and somebody in a box who walks the other way: a grid of keypoints,
// of which those in the box belong in turn to the person and to the wall behind.
class PastViewsTest : public ::testing::Test {
 protected:
  PastViewsTest() {
    for (int row = 0; row < 14; ++row) {
      for (int col = 0; col < 18; ++col) {
        places_.emplace_back(30.0 + 32 * col, 20.0 + 32 * row);
        descriptors_.push_back({random_.Next(), random_.Next(), random_.Next(), random_.Next()});
        on_person_.push_back(InBox(places_.back(), 20) && (row + col) % 2 == 0);
      }
    }
  }

  static Box PersonBox() { return {200, 60, 200, 360}; }

  // So far inside that it stays there.
  static bool InBox(const Eigen::Vector2d& px, double inside_px) {
    return PersonBox().Contains(px.x(), px.y(), -inside_px);
  }

  // What is at rest does so; the person's keypoints move by person_step_px a frame.
  Frame MakeFrame(uint32_t id, double person_step_px) const {
    Frame frame;
    frame.id = FrameId(id);
    frame.timestamp_s = id / 30.0;
    frame.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {-kCameraStep * id, 0, 0});
    for (size_t i = 0; i < places_.size(); ++i) {
      const double step_px = on_person_[i] ? person_step_px : -camera_.fx * kCameraStep / kDepth;
      Keypoint keypoint;
      keypoint.x = keypoint.raw_x = static_cast<float>(places_[i].x() + step_px * id);
      keypoint.y = keypoint.raw_y = static_cast<float>(places_[i].y());
      frame.features.keypoints.push_back(keypoint);
      frame.features.descriptors.push_back(descriptors_[i]);
    }
    frame.grid.Build(frame.features, camera_.IdealBounds());
    frame.ClearLandmarks();
    return frame;
  }

  // The last of kFrames, when the person moves by person_step_px and is said to move by told_step_px.
  std::span<const float> Run(double person_step_px, double told_step_px, uint32_t skipped = kFrames) {
    ShiftHistory shifts;
    for (uint32_t id = 0; id + 1 < kFrames; ++id) {
      if (id > 0) shifts.Add({told_step_px, 0});
      if (id != skipped) views_.Add(MakeFrame(id, person_step_px));
    }
    shifts.Add({told_step_px, 0});
    last_ = MakeFrame(kFrames - 1, person_step_px);
    const std::vector<PastViews::Object> objects{{PersonBox(), 0, &shifts}};
    return views_.Judge(last_, All(last_), objects, 0.3 * kDepth);
  }

  static std::vector<uint32_t> All(const Frame& frame) {
    std::vector<uint32_t> keypoints(frame.features.size());
    std::iota(keypoints.begin(), keypoints.end(), 0u);
    return keypoints;
  }

  Camera camera_ = TestCamera();
  Random random_{3};
  std::vector<Eigen::Vector2d> places_;
  std::vector<Descriptor> descriptors_;
  std::vector<bool> on_person_;
  Frame last_;
  PastViews views_{camera_, {1.0f, 1.2f}};
};

// The keypoints that stay well inside the box all the time.
TEST_F(PastViewsTest, TellWhoWalksSlowlyFromTheWallBehind) {
  const std::span<const float> evidence = Run(kPersonStep_px, kPersonStep_px);
  int wall = 0, person = 0;
  for (size_t i = 0; i < places_.size(); ++i) {
    if (!InBox(places_[i], 20)) continue;
    ++(on_person_[i] ? person : wall);
    if (on_person_[i]) {
      EXPECT_LT(evidence[i], -1) << i;
    } else {
      EXPECT_GT(evidence[i], 0.5) << i;
    }
  }
  EXPECT_GT(wall, 5);
  EXPECT_GT(person, 5);
}

TEST_F(PastViewsTest, AskEachOfTheThreeAgesInTurn) {
  // Only the oldest view is from so long ago that who moves so slowly is apart from the wall.
  constexpr double kSlowStep_px = 1.3;
  ShiftHistory shifts;
  int tell = 0;
  for (uint32_t id = 0; id < kFrames + 3; ++id) {
    const Frame frame = MakeFrame(id, kSlowStep_px);
    if (id > 0) shifts.Add({kSlowStep_px, 0});
    const std::vector<PastViews::Object> objects{{PersonBox(), 0, &shifts}};
    const std::span<const float> evidence = views_.Judge(frame, All(frame), objects, 0.3 * kDepth);
    if (id >= kFrames) tell += std::ranges::any_of(evidence, [](float e) { return e != 0; });
    views_.Add(frame);
  }
  EXPECT_EQ(tell, 1);
}

TEST_F(PastViewsTest, SayNothingOfWhatIsInNoBox) {
  const std::span<const float> evidence = Run(kPersonStep_px, kPersonStep_px);
  for (size_t i = 0; i < places_.size(); ++i) {
    if (!PersonBox().Contains(places_[i].x(), places_[i].y(), 40)) {
      EXPECT_EQ(evidence[i], 0) << i;
    }
  }
}

TEST_F(PastViewsTest, DoNotBelieveAMotionThatNothingInTheBoxMakes) {
  const double rest_step_px = -camera_.fx * kCameraStep / kDepth;
  for (const float evidence : Run(rest_step_px, kPersonStep_px)) EXPECT_EQ(evidence, 0);
}

TEST_F(PastViewsTest, SayNothingOfWhoMovesAsWhatIsAtRest) {
  const double rest_step_px = -camera_.fx * kCameraStep / kDepth;
  for (const float evidence : Run(rest_step_px, rest_step_px)) EXPECT_EQ(evidence, 0);
}

TEST_F(PastViewsTest, AMissingFrameEndsWhatWasBefore) {
  for (const float evidence : Run(kPersonStep_px, kPersonStep_px, kFrames - 2)) EXPECT_EQ(evidence, 0);
}

TEST_F(PastViewsTest, ACornerThatIsNewIsAsWhatIsAroundIt) {
  ShiftHistory shifts;
  for (uint32_t id = 0; id + 1 < kFrames; ++id) {
    if (id > 0) shifts.Add({kPersonStep_px, 0});
    views_.Add(MakeFrame(id, kPersonStep_px));
  }
  shifts.Add({kPersonStep_px, 0});
  last_ = MakeFrame(kFrames - 1, kPersonStep_px);
  // Beside each keypoint another one that no view before has.
  const size_t n = last_.features.size();
  for (size_t i = 0; i < n; ++i) {
    Keypoint keypoint = last_.features.keypoints[i];
    keypoint.x += 5;
    keypoint.raw_x += 5;
    last_.features.keypoints.push_back(keypoint);
    last_.features.descriptors.push_back({random_.Next(), random_.Next(), random_.Next(), random_.Next()});
  }
  last_.grid.Build(last_.features, camera_.IdealBounds());
  last_.ClearLandmarks();
  const std::vector<PastViews::Object> objects{{PersonBox(), 0, &shifts}};
  const std::span<const float> evidence = views_.Judge(last_, All(last_), objects, 0.3 * kDepth);
  for (size_t i = 0; i < n; ++i) {
    if (!InBox(places_[i], 20)) continue;
    if (on_person_[i]) {
      EXPECT_LT(evidence[n + i], 0) << i;
    } else {
      EXPECT_GT(evidence[n + i], 0) << i;
    }
  }
}

TEST(ShiftHistory, SumsTheLastAndKnowsNoMoreThanItHolds) {
  ShiftHistory shifts;
  EXPECT_FALSE(shifts.Sum(1).has_value());
  for (int i = 1; i <= 20; ++i) shifts.Add({i, -i});
  EXPECT_EQ(shifts.Sum(2).value(), Eigen::Vector2d(39, -39));
  EXPECT_EQ(shifts.Sum(16).value(), Eigen::Vector2d(200, -200));  // 5 to 20
  EXPECT_FALSE(shifts.Sum(17).has_value());
  shifts.Clear();
  EXPECT_FALSE(shifts.Sum(1).has_value());
}

}  // namespace
}  // namespace dynamic_slam
