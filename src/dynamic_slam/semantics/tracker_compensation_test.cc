#include "dynamic_slam/semantics/tracker_compensation.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/semantics/compensation_test_scene.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

const std::vector<Detection> kNothing;

class TrackerCompensationTest : public testing::Test {
 protected:
  TrackerCompensation tracker_{TrackerCompensationOptions(), TestCamera()};
  Feed feed_{&tracker_};
};

// Frames for which the box is shown after `seen` detections with the score.
int HeldFrames(int seen, double score) {
  TrackerCompensation tracker(TrackerCompensationOptions(), TestCamera());
  Feed feed(&tracker);
  for (int i = 0; i < seen; ++i) feed.See({{At(100, 100, kPerson, score)}});
  int held = 0;
  while (!feed.See(kNothing).empty()) ++held;
  return held;
}

TEST_F(TrackerCompensationTest, PredictsThroughMisses) {
  for (int i = 0; i < 30; ++i) feed_.See({{At(100 + 4 * i, 100)}});
  for (int miss = 1; miss <= 3; ++miss) {
    const auto boxes = feed_.See(kNothing);
    ASSERT_THAT(boxes, SizeIs(1));
    EXPECT_FALSE(boxes[0].is_detected);
    EXPECT_EQ(boxes[0].missed_frames, miss);
    EXPECT_EQ(boxes[0].track_id, 0);
    EXPECT_NEAR(boxes[0].box.x, 216 + 4 * miss, 3);  // its velocity decays a little
    EXPECT_NEAR(boxes[0].box.width, 100, 1);
  }
  const auto boxes = feed_.See({{At(232, 100)}});
  EXPECT_EQ(boxes[0].track_id, 0);
  EXPECT_TRUE(boxes[0].is_detected);
  EXPECT_EQ(boxes[0].age_frames, 34);
}

TEST_F(TrackerCompensationTest, WhatIsDetectedIsWhereTheDetectorSawIt) {
  for (int i = 0; i < 10; ++i) feed_.See({{At(100, 100)}});
  const auto boxes = feed_.See({{At(112, 93)}});
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_EQ(boxes[0].box.x, 112);
  EXPECT_EQ(boxes[0].box.y, 93);
}

TEST(TrackerCompensation, HoldsABoxTheLongerTheLongerAndBetterItWasSeen) {
  EXPECT_EQ(HeldFrames(1, 0.41), 0);
  // Log-odds of 0.8 over those of 0.45 are 1.59 a frame, at most 6; a miss takes 1.5.
  EXPECT_EQ(HeldFrames(1, 0.8), 1);
  EXPECT_EQ(HeldFrames(2, 0.8), 2);
  EXPECT_EQ(HeldFrames(100, 0.8), 3);
  EXPECT_EQ(HeldFrames(100, 0.95), 3);
}

TEST_F(TrackerCompensationTest, NoResultIsNoEvidenceButLifeIsBounded) {
  for (int i = 0; i < 10; ++i) feed_.See({{At(100, 100)}});
  for (int i = 0; i < 44; ++i) ASSERT_THAT(feed_.See(std::nullopt), SizeIs(1)) << i;
  feed_.See(std::nullopt);
  EXPECT_THAT(feed_.See(std::nullopt), IsEmpty());  // more than 1.5 s
}

TEST_F(TrackerCompensationTest, LowScoresAreNotLookedAt) {
  EXPECT_THAT(feed_.See({{At(100, 100, kPerson, 0.39)}}), IsEmpty());
  for (int i = 0; i < 5; ++i) feed_.See({{At(100, 100)}});
  EXPECT_FALSE(feed_.See({{At(100, 100, kPerson, 0.39)}})[0].is_detected);
}

TEST_F(TrackerCompensationTest, CrossingBoxesKeepTheirNames) {
  for (int i = 0; i < 60; ++i) {
    // The one behind is not detected while they overlap much.
    const double left = 50 + 6 * i, right = 410 - 6 * i;
    std::vector<Detection> seen = {At(left, 100)};
    if (std::abs(left - right) > 50) seen.push_back(At(right, 110));
    const auto boxes = feed_.See(seen);
    if (seen.size() == 1) continue;
    ASSERT_THAT(boxes, SizeIs(2)) << i;
    EXPECT_EQ(boxes[0].track_id, 0);
    EXPECT_NEAR(boxes[0].box.x, left, 15) << i;
    EXPECT_EQ(boxes[1].track_id, 1);
    EXPECT_NEAR(boxes[1].box.x, right, 15) << i;
  }
}

TEST_F(TrackerCompensationTest, DuplicatesAreOneBox) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_THAT(feed_.See({{At(100, 100), At(100, 100), At(104, 102, kPerson, 0.8)}}), SizeIs(1));
  }
}

TEST_F(TrackerCompensationTest, APersonStaysAPerson) {
  for (int i = 0; i < 5; ++i) feed_.See({{At(100, 100, kPerson)}});
  auto boxes = feed_.See({{At(102, 100, kCar)}});
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_EQ(boxes[0].class_id, kPerson);
  EXPECT_TRUE(boxes[0].is_detected);
  // A car elsewhere is a car, and two classes in one place are two objects.
  boxes = feed_.See({{At(100, 100, kPerson), At(100, 100, kCar), At(400, 100, kCar)}});
  ASSERT_THAT(boxes, SizeIs(3));
  EXPECT_EQ(boxes[0].class_id, kPerson);
  EXPECT_EQ(boxes[1].class_id, kCar);
  EXPECT_EQ(boxes[2].class_id, kCar);
}

TEST_F(TrackerCompensationTest, ABoxThatLeavesTheImageEnds) {
  for (int i = 0; i < 40; ++i) {
    const double x = 300 - 10 * i;
    if (x + 100 > 5) feed_.See({{At(x, 100)}});
  }
  for (int i = 0; i < 4; ++i) feed_.See(kNothing);
  EXPECT_THAT(tracker_.Boxes(), IsEmpty());
}

TEST_F(TrackerCompensationTest, ABoxAtTheBorderGoesOnMovingOut) {
  // Its left half leaves the image at 4 px a frame: the detections stay at x = 0 and shrink.
  for (int i = 0; i < 30; ++i) feed_.See({{At(70 - 4 * i, 100)}});
  const auto boxes = feed_.See(kNothing);
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_EQ(boxes[0].box.x, 0);
  EXPECT_NEAR(boxes[0].box.width, 50, 8);
}

TEST_F(TrackerCompensationTest, TheCamerasRotationIsTakenOut) {
  // A resting object; the camera stands still, then pans by 0.02 rad a frame while the detector is silent.
  const Camera camera = TestCamera();
  Eigen::Vector3d ray = camera.Unproject({250, 200});
  for (int i = 0; i < 10; ++i) feed_.See({{At(200, 100)}}, Eigen::Quaterniond::Identity());
  const Eigen::Quaterniond pan = ExpSo3({0, 0.02, 0});
  std::vector<CompensatedBox> boxes;
  for (int i = 0; i < 8; ++i) {
    ray = pan * ray;
    boxes = feed_.See(std::nullopt, pan);
  }
  ASSERT_THAT(boxes, SizeIs(1));
  const Eigen::Vector2d wanted = camera.Project(ray);
  EXPECT_GT(wanted.x(), 320);
  EXPECT_NEAR(boxes[0].box.CenterX(), wanted.x(), 1e-6);
  EXPECT_NEAR(boxes[0].box.CenterY(), wanted.y(), 1e-6);
  // The object did not move: without rotations it stays where it is.
  EXPECT_NEAR(feed_.See(std::nullopt)[0].box.CenterX(), wanted.x(), 1e-6);
}

TEST_F(TrackerCompensationTest, ARotationThatIsCorrectedLaterCounts) {
  for (int i = 0; i < 10; ++i) feed_.See({{At(200, 100)}});
  feed_.See(std::nullopt, ExpSo3({0, 0.05, 0}));
  EXPECT_GT(tracker_.Boxes()[0].box.x, 210);
  EXPECT_TRUE(tracker_.UpdateRotation(FrameId(10), Eigen::Quaterniond::Identity()));
  EXPECT_NEAR(tracker_.Boxes()[0].box.x, 200, 1e-6);
  EXPECT_FALSE(tracker_.UpdateRotation(FrameId(11), Eigen::Quaterniond::Identity()));
}

TEST_F(TrackerCompensationTest, TurningAwayEndsABox) {
  feed_.See({{At(200, 100)}});
  EXPECT_THAT(feed_.See(std::nullopt, ExpSo3({0, 1.6, 0})), IsEmpty());
}

TEST_F(TrackerCompensationTest, FollowsThePointsInABox) {
  for (int i = 0; i < 3; ++i) feed_.See({{At(200, 100)}});
  std::vector<PointMotion> motions;
  for (double x = 230; x < 270; x += 8) {
    for (double y = 110; y < 290; y += 12) motions.push_back({{x, y}, {x + 13, y - 7}});
  }
  const auto boxes = feed_.See(std::nullopt, std::nullopt, motions);
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_NEAR(boxes[0].box.x, 213, 1e-6);
  EXPECT_NEAR(boxes[0].box.y, 93, 1e-6);
}

// Someone stands at x = 240; someone else comes from the right, 5 px a frame, and stops in front at 205.
double InFrontX(int frame) { return std::max(205.0, 405.0 - 5 * frame); }

TEST_F(TrackerCompensationTest, SomeoneBehindSomeoneIsStillThere) {
  for (int i = 0; i < 50; ++i) {
    std::vector<Detection> seen = {At(InFrontX(i), 90)};
    if (InFrontX(i) > 280) seen.push_back(At(240, 100));
    ASSERT_THAT(feed_.See(seen), SizeIs(2)) << i;
  }
  // Not for ever.
  for (int i = 50; i < 70; ++i) feed_.See({{At(205, 90)}});
  EXPECT_THAT(tracker_.Boxes(), SizeIs(1));
}

TEST_F(TrackerCompensationTest, ASecondBoxAroundTheSameObjectIsGivenUp) {
  // Twelve frames with both, but never apart.
  for (int i = 0; i < 12; ++i) feed_.See({{At(240, 100), At(205, 90)}});
  for (int i = 0; i < 3; ++i) EXPECT_THAT(feed_.See({{At(205, 90)}}), SizeIs(2));
  EXPECT_THAT(feed_.See({{At(205, 90)}}), SizeIs(1));
}

TEST_F(TrackerCompensationTest, BoxesThatCrossKeepTheirOwnPoints) {
  // One walks left and one right, 4 px a frame, and the one in front hides the other's points. They are
  // detected in every frame while apart, and then not at all.
  for (int i = 0; i <= 60; ++i) {
    const double front = 400 - 4 * i, behind = 160 + 4 * i;
    std::vector<PointMotion> motions;
    for (double x = 3; x < 640; x += 8) {
      for (double y = 103; y < 280; y += 20) {
        const bool is_in_front = x > front + 4 && x < front + 104;
        const bool is_behind = x > behind - 4 && x < behind + 96;
        motions.push_back({{x, y}, {x + (is_in_front ? -4 : is_behind ? 4 : 0), y}});
      }
    }
    std::optional<std::vector<Detection>> seen;
    if (i <= 20) seen = {At(front, 100), At(behind, 100)};
    const auto boxes = feed_.See(seen, std::nullopt, motions);
    ASSERT_THAT(boxes, SizeIs(2)) << i;
    EXPECT_NEAR(boxes[0].box.x, front, 12) << i;
    EXPECT_NEAR(boxes[1].box.x, behind, 25) << i;
  }
}

TEST_F(TrackerCompensationTest, WhatLeftTheImageMayComeBack) {
  for (int i = 0; i < 3; ++i) feed_.See({{At(500, 100)}});
  const Eigen::Quaterniond pan = ExpSo3({0, 0.1, 0});
  for (int i = 0; i < 4; ++i) feed_.See(std::nullopt, pan);
  EXPECT_THAT(tracker_.Boxes(), IsEmpty());
  for (int i = 0; i < 4; ++i) feed_.See(std::nullopt, pan.inverse());
  ASSERT_THAT(tracker_.Boxes(), SizeIs(1));
  EXPECT_EQ(tracker_.Boxes()[0].track_id, 0);
}

TEST_F(TrackerCompensationTest, AnUnseenBoxRidesOnTheBackground) {
  for (int i = 0; i < 3; ++i) feed_.See({{At(200, 100)}});
  std::vector<PointMotion> motions;
  for (double x = 400; x < 600; x += 20) {
    for (double y = 20; y < 460; y += 40) motions.push_back({{x, y}, {x + 9, y - 2}});
  }
  const auto boxes = feed_.See(std::nullopt, std::nullopt, motions);
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_NEAR(boxes[0].box.x, 209, 1e-6);
  EXPECT_NEAR(boxes[0].box.y, 98, 1e-6);
}

TEST_F(TrackerCompensationTest, LateResultsAreAsGoodAsThoseInTime) {
  TrackerCompensation in_time(TrackerCompensationOptions(), TestCamera());
  Feed feed(&in_time);
  Random random(11);
  std::vector<std::vector<Detection>> seen;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Quaterniond turn = ExpSo3({random.Uniform(-0.02, 0.02), random.Uniform(-0.02, 0.02), 0});
    seen.push_back({At(100 + 4 * i, 100), At(400 - 3 * i, 120, kCar)});
    if (i % 3 == 0) seen.back().pop_back();
    feed.See(seen.back(), turn);
    feed_.See(std::nullopt, turn);
    if (i >= 10) {
      EXPECT_TRUE(tracker_.UpdateLate(FrameId(i - 10), seen[i - 10]));
    }
  }
  for (int i = 30; i < 40; ++i) EXPECT_TRUE(tracker_.UpdateLate(FrameId(i), seen[i]));
  const auto boxes = tracker_.Boxes();
  const auto wanted = in_time.Boxes();
  ASSERT_EQ(boxes.size(), wanted.size());
  for (size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_EQ(boxes[i].track_id, wanted[i].track_id);
    EXPECT_EQ(boxes[i].box.x, wanted[i].box.x);
    EXPECT_EQ(boxes[i].score, wanted[i].score);
  }
}

TEST_F(TrackerCompensationTest, AResultThatIsTooLateChangesNothing) {
  for (size_t i = 0; i < BoxCompensation::kHistoryFrames + 1; ++i) feed_.See({{At(100, 100)}});
  EXPECT_FALSE(tracker_.UpdateLate(FrameId(0), {}));
  EXPECT_TRUE(tracker_.UpdateLate(FrameId(1), {{At(100, 100)}}));
  EXPECT_THAT(tracker_.Boxes(), SizeIs(1));
}

}  // namespace
}  // namespace dynamic_slam
