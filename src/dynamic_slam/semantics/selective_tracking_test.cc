#include "dynamic_slam/semantics/selective_tracking.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"

namespace dynamic_slam {
namespace {

using Eigen::Vector2d;
using enum KeypointJudgement;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kWidth = 640, kHeight = 480;

// Keypoints every 20 px over the whole image, moved as a test says.
struct Keypoints {
  std::vector<Vector2d> positions_px;
  std::vector<std::optional<Vector2d>> displacements_px;

  void Add(const Vector2d& position_px, const std::optional<Vector2d>& displacement_px) {
    positions_px.push_back(position_px);
    displacements_px.push_back(displacement_px);
  }
  SelectiveResult Judge(const std::vector<Box>& boxes, const SelectiveOptions& options = {}) const {
    return SelectiveTracking(options, positions_px, displacements_px, boxes);
  }
};

using Motion = std::function<Vector2d(const Vector2d& position_px)>;

// Keypoints in a box move like the first such box's object, all others like the background.
Keypoints Scene(const Motion& background, const std::vector<std::pair<Box, Motion>>& objects) {
  Keypoints keypoints;
  for (int y = 10; y < kHeight; y += 20) {
    for (int x = 10; x < kWidth; x += 20) {
      const Vector2d position(x, y);
      const Motion* motion = &background;
      for (auto object = objects.rbegin(); object != objects.rend(); ++object) {
        if (object->first.Contains(x, y)) motion = &object->second;
      }
      keypoints.Add(position, (*motion)(position));
    }
  }
  return keypoints;
}

Motion Constant(double dx, double dy) {
  return [=](const Vector2d&) { return Vector2d(dx, dy); };
}

// Of the keypoints in the box, all have the judgement.
void ExpectInBox(const Keypoints& keypoints, const SelectiveResult& result, const Box& box,
                 KeypointJudgement expected) {
  int count = 0;
  for (size_t i = 0; i < result.keypoints.size(); ++i) {
    const Vector2d& p = keypoints.positions_px[i];
    if (!box.Contains(p.x(), p.y())) continue;
    EXPECT_EQ(result.keypoints[i], expected) << p.transpose();
    ++count;
  }
  EXPECT_GT(count, 0);
}

size_t Count(const SelectiveResult& result, KeypointJudgement judgement) {
  return static_cast<size_t>(std::count(result.keypoints.begin(), result.keypoints.end(), judgement));
}

TEST(DynamicMaskTest, IsTheBoxesAndNothingElse) {
  const std::vector<Box> boxes = {{10, 20, 30, 40}, {25.5, 50.2, 30.1, 3}, {-50, -50, 60.5, 55}};
  const cv::Mat mask = DynamicMask(boxes, 64, 70);
  ASSERT_EQ(mask.size(), cv::Size(64, 70));
  ASSERT_EQ(mask.type(), CV_8UC1);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const bool is_inside =
          std::any_of(boxes.begin(), boxes.end(), [&](const Box& box) { return box.Contains(u, v); });
      EXPECT_EQ(mask.at<uchar>(v, u), is_inside ? 255 : 0) << u << " " << v;
    }
  }
}

TEST(DynamicMaskTest, BoxesOutsideTheImageOrWithoutSense) {
  const std::vector<Box> nothing = {{100, 0, 20, 20},  {0, -30, 20, 20}, {5, 5, 0, 10},       {5, 5, -3, 10},
                                    {kNan, 5, 10, 10}, {5, 5, 10, kNan}, {5, 5, 10, HUGE_VAL}};
  EXPECT_EQ(cv::countNonZero(DynamicMask(nothing, 64, 48)), 0);
  EXPECT_EQ(cv::countNonZero(DynamicMask({}, 64, 48)), 0);
  const std::vector<Box> all = {{-1e300, -1e300, 2e300, 2e300}};
  EXPECT_EQ(cv::countNonZero(DynamicMask(all, 64, 48)), 64 * 48);
}

TEST(SelectiveTrackingTest, MeanRingAndToleranceByHand) {
  // Mean side 80 px, so l = 20 px: from (80, 60) to (200, 260).
  const Box box{100, 80, 80, 80};
  Keypoints keypoints;
  keypoints.Add({85, 100}, Vector2d(9, 0));
  keypoints.Add({190, 170}, Vector2d(11, 0));
  keypoints.Add({79, 100}, Vector2d(500, 0));  // a pixel too far
  keypoints.Add({110, 61}, std::nullopt);      // no match
  keypoints.Add({140, 120}, Vector2d(10, 2.9));
  keypoints.Add({140, 130}, Vector2d(10, -3.1));
  keypoints.Add({140, 140}, Vector2d(13, 0));
  keypoints.Add({140, 150}, std::nullopt);
  SelectiveOptions options;
  options.ring_ratio = 0.25;
  options.rho = 0.3;
  options.min_tolerance_px = 1;
  options.min_static_points = 2;
  const SelectiveResult result = keypoints.Judge({box}, options);
  ASSERT_EQ(result.boxes.size(), 1u);
  EXPECT_EQ(result.boxes[0].ring_px, 20);
  EXPECT_EQ(result.boxes[0].static_points, 2);
  EXPECT_EQ(result.boxes[0].static_displacement_px, Vector2d(10, 0));
  EXPECT_THAT(result.keypoints,
              testing::ElementsAre(kStatic, kStatic, kStatic, kStatic, kKept, kCulled, kKept, kUnknown));
}

TEST(SelectiveTrackingTest, ParkedCarIsKept) {
  // The camera drives by: the wall behind moves by 12 px, the car, which is nearer, by 15.
  const Box car{200, 200, 200, 120};
  const Keypoints keypoints = Scene(Constant(-12, 0), {{car, Constant(-15, 0)}});
  ExpectInBox(keypoints, keypoints.Judge({car}), car, kKept);
  // Under way, it moves by 30.
  const Keypoints driving = Scene(Constant(-12, 0), {{car, Constant(-30, 0)}});
  ExpectInBox(driving, driving.Judge({car}), car, kCulled);
}

TEST(SelectiveTrackingTest, WalkerIsCulledInEveryDirection) {
  const Box person{300, 100, 80, 300};
  // With the camera's motion, against it, across it, and followed by the camera: at rest in the image.
  for (const Vector2d& motion : {Vector2d(9, 0), Vector2d(-5, 0), Vector2d(5, 4), Vector2d(0, 0)}) {
    const Keypoints keypoints = Scene(Constant(5, 0), {{person, Constant(motion.x(), motion.y())}});
    const SelectiveResult result = keypoints.Judge({person});
    ExpectInBox(keypoints, result, person, kCulled);
    EXPECT_EQ(Count(result, kCulled) + Count(result, kStatic), result.keypoints.size());
  }
}

TEST(SelectiveTrackingTest, OnlyTheMovingPartOfABoxIsCulled) {
  // Left and right of a person the box shows the wall behind.
  const Box box{300, 100, 120, 300}, body{340, 100, 40, 300};
  const Keypoints keypoints = Scene(Constant(1, 0), {{body, Constant(8, 0)}});
  const SelectiveResult result = keypoints.Judge({box});
  ExpectInBox(keypoints, result, body, kCulled);
  ExpectInBox(keypoints, result, {300, 100, 40, 300}, kKept);
  ExpectInBox(keypoints, result, {380, 100, 40, 300}, kKept);
}

TEST(SelectiveTrackingTest, PersonWhoFillsHalfOfTheViewIsCulled) {
  const Box person{-20, -10, 340, 500};  // the left half, and reaching out of the image
  const Keypoints keypoints = Scene(Constant(3, 0), {{person, Constant(10, 1)}});
  const SelectiveResult result = keypoints.Judge({person});
  ExpectInBox(keypoints, result, person, kCulled);
  ExpectInBox(keypoints, result, {320, 0, 320, 480}, kStatic);
  EXPECT_EQ(*result.boxes.at(0).static_displacement_px, Vector2d(3, 0));
}

TEST(SelectiveTrackingTest, CameraAtRest) {
  const Box sitting{100, 100, 100, 200}, walking{400, 100, 100, 300};
  const Keypoints keypoints =
      Scene(Constant(0, 0), {{sitting, Constant(0.7, -0.5)}, {walking, Constant(4, 0)}});
  const SelectiveResult result = keypoints.Judge({sitting, walking});
  ExpectInBox(keypoints, result, sitting, kKept);  // within the noise of positions
  ExpectInBox(keypoints, result, walking, kCulled);
}

TEST(SelectiveTrackingTest, PureRotationHasNoParallaxAndCullsNothing) {
  const Box box{200, 120, 200, 240};
  // About the vertical axis by 2 deg, f = 500 px: x -> f tan(atan(x / f) + a), whatever the depth.
  const Motion pan = [](const Vector2d& p) {
    const double f = 500, a = 2 * M_PI / 180, x = p.x() - 320, y = p.y() - 240;
    const double depth = std::cos(a) - x / f * std::sin(a);
    return Vector2d(f * (std::sin(a) + x / f * std::cos(a)) / depth - x, y / depth - y);
  };
  const Keypoints panned = Scene(pan, {});
  ExpectInBox(panned, panned.Judge({box}), box, kKept);
  // About the optical axis by 0.5 deg.
  const Motion roll = [](const Vector2d& p) {
    const Eigen::Matrix2d R = Eigen::Rotation2Dd(0.5 * M_PI / 180).toRotationMatrix();
    const Vector2d centred = p - Vector2d(320, 240);
    return Vector2d(R * centred - centred);
  };
  const Keypoints rolled = Scene(roll, {});
  ExpectInBox(rolled, rolled.Judge({box}), box, kKept);
}

TEST(SelectiveTrackingTest, BoxAtTheEdgeComparesWithWhatTheImageHas) {
  for (const Box& box : {Box{0, 0, 100, 200}, Box{560, 300, 80, 180}, Box{-500, 200, 560, 100}}) {
    const Keypoints keypoints = Scene(Constant(6, 0), {{box, Constant(-6, 0)}});
    const SelectiveResult result = keypoints.Judge({box});
    ExpectInBox(keypoints, result, box, kCulled);
    EXPECT_EQ(*result.boxes.at(0).static_displacement_px, Vector2d(6, 0));
  }
}

TEST(SelectiveTrackingTest, ABoxIsNoStaticSurroundingOfAnother) {
  // Between two walkers who stand close: all of the ring's left side is the other one.
  const Box left{200, 100, 100, 300}, right{300, 100, 100, 300};
  const Keypoints keypoints = Scene(Constant(2, 0), {{left, Constant(9, 0)}, {right, Constant(9, 0)}});
  const SelectiveResult result = keypoints.Judge({left, right});
  for (const SelectiveBox& box : result.boxes) EXPECT_EQ(*box.static_displacement_px, Vector2d(2, 0));
  ExpectInBox(keypoints, result, left, kCulled);
  ExpectInBox(keypoints, result, right, kCulled);
}

TEST(SelectiveTrackingTest, InOverlappingBoxesEachKeypointGoesByItsOwnMotion) {
  const Box walker{300, 100, 100, 300}, car{200, 250, 300, 150};  // the walker is in front of a parked car
  const Keypoints keypoints = Scene(Constant(4, 0), {{walker, Constant(-6, 0)}, {car, Constant(5, 0)}});
  for (const std::vector<Box>& boxes : {std::vector{walker, car}, std::vector{car, walker}}) {
    const SelectiveResult result = keypoints.Judge(boxes);
    ExpectInBox(keypoints, result, {200, 250, 100, 150}, kKept);
    ExpectInBox(keypoints, result, {400, 250, 100, 150}, kKept);
    size_t culled = 0, kept = 0;
    for (size_t i = 0; i < result.keypoints.size(); ++i) {
      const bool moves = keypoints.displacements_px[i]->x() < 0;
      culled += result.keypoints[i] == kCulled;
      kept += result.keypoints[i] == kKept;
      if (moves) {
        EXPECT_EQ(result.keypoints[i], kCulled);
      }
    }
    EXPECT_GT(culled, 0u);
    EXPECT_GT(kept, 0u);
  }
}

TEST(SelectiveTrackingTest, WhereTheBoxesDisagreeTheKeypointIsCulled) {
  // Static points move differently at both ends of the image; the keypoint in both boxes suits one of them.
  Keypoints keypoints;
  for (int i = 0; i < 5; ++i) {
    keypoints.Add({90, 100.0 + 10 * i}, Vector2d(10, 0));
    keypoints.Add({510, 100.0 + 10 * i}, Vector2d(30, 0));
  }
  keypoints.Add({300, 120}, Vector2d(10, 0));
  const Box left{100, 80, 220, 80}, right{280, 80, 220, 80};
  EXPECT_EQ(keypoints.Judge({left}).keypoints.back(), kKept);
  EXPECT_EQ(keypoints.Judge({left, right}).keypoints.back(), kCulled);
  EXPECT_EQ(keypoints.Judge({right, left}).keypoints.back(), kCulled);
}

TEST(SelectiveTrackingTest, FewStaticPointsAroundTheBoxAreSoughtFartherAway) {
  const Box person{250, 100, 100, 100};
  Keypoints keypoints;
  keypoints.Add({300, 150}, Vector2d(9, 0));
  for (int i = 0; i < 5; ++i) keypoints.Add({420.0, 110.0 + 10 * i}, Vector2d(1, 0));  // 70 px away
  SelectiveResult result = keypoints.Judge({person});
  EXPECT_EQ(result.boxes.at(0).ring_px, 100) << "25, 50, 100";
  EXPECT_EQ(result.boxes.at(0).static_points, 5);
  EXPECT_EQ(result.keypoints[0], kCulled);
}

TEST(SelectiveTrackingTest, WithoutStaticPointsNothingIsJudged) {
  const Box all{0, 0, kWidth, kHeight};
  const Keypoints filled = Scene(Constant(5, 0), {});
  const SelectiveResult result = filled.Judge({all});
  EXPECT_EQ(Count(result, kUnknown), result.keypoints.size());
  EXPECT_FALSE(result.boxes.at(0).static_displacement_px.has_value());
  EXPECT_EQ(result.boxes.at(0).static_points, 0);

  Keypoints four;  // one too few
  for (int i = 0; i < 4; ++i) four.Add({90.0, 110.0 + 10 * i}, Vector2d(1, 0));
  four.Add({150, 150}, Vector2d(1, 0));
  EXPECT_EQ(four.Judge({{100, 100, 100, 100}}).keypoints.back(), kUnknown);
}

TEST(SelectiveTrackingTest, NoBoxesOrNoKeypoints) {
  const Keypoints keypoints = Scene(Constant(5, 0), {});
  const SelectiveResult result = keypoints.Judge({});
  EXPECT_EQ(Count(result, kStatic), result.keypoints.size());
  EXPECT_TRUE(result.boxes.empty());
  EXPECT_TRUE(Keypoints().Judge({{0, 0, 10, 10}}).keypoints.empty());
}

TEST(SelectiveTrackingTest, ValuesThatAreNotFinite) {
  const Box box{200, 100, 200, 200};
  Keypoints keypoints = Scene(Constant(3, 0), {{box, Constant(3, 0)}});
  const size_t known = keypoints.positions_px.size();
  keypoints.Add({300, 200}, Vector2d(kNan, 0));
  keypoints.Add({300, 200}, Vector2d(HUGE_VAL, 0));
  keypoints.Add({410, 200}, Vector2d(kNan, 0));  // in the ring: must not reach the mean
  keypoints.Add({kNan, 200}, Vector2d(3, 0));
  keypoints.Add({410, HUGE_VAL}, Vector2d(3, 0));
  const SelectiveResult result = keypoints.Judge({box, {kNan, 0, 10, 10}, {0, 0, HUGE_VAL, 10}});
  EXPECT_EQ(*result.boxes.at(0).static_displacement_px, Vector2d(3, 0));
  EXPECT_FALSE(result.boxes.at(1).static_displacement_px.has_value());
  ExpectInBox(Scene(Constant(3, 0), {}), {{result.keypoints.begin(), result.keypoints.begin() + known}, {}},
              box, kKept);
  EXPECT_THAT(std::vector(result.keypoints.begin() + known, result.keypoints.end()),
              testing::ElementsAre(kUnknown, kUnknown, kStatic, kUnknown, kUnknown));

  Keypoints far;  // l overflows before it reaches the static points
  for (int i = 0; i < 5; ++i) far.Add({1.7e308, 1.7e308}, Vector2d(1, 0));
  far.Add({150, 150}, Vector2d(1, 0));
  EXPECT_EQ(far.Judge({{100, 100, 100, 100}}).keypoints.back(), kKept);
}

TEST(SelectiveTrackingTest, ArraysOfDifferentLengthsAreABug) {
  const std::vector<Vector2d> positions(2);
  const std::vector<std::optional<Vector2d>> displacements(1);
  EXPECT_THROW(SelectiveTracking({}, positions, displacements, {}), InternalError);
}

TEST(SelectiveTrackingTest, OptionsAreInTheirRanges) { CheckOptions(SelectiveOptions()); }

}  // namespace
}  // namespace dynamic_slam
