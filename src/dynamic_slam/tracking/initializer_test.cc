#include "dynamic_slam/tracking/initializer.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class InitializerTest : public ::testing::Test {
 protected:
  bool Try(const Rigid3& cam_from_world) {
    views_.push_back(world_.See(cam_from_world));
    return Start(&views_.back().frame);
  }

  bool Start(Frame* frame) {
    const std::optional<InitialProposal> proposal = initializer_.Propose(*frame, random_);
    if (!proposal.has_value() || !proposal->is_certain) return false;
    earlier_ = initializer_.BuildMap(*proposal, frame, &map_);
    return true;
  }

  SyntheticWorld world_{1500, 0.1};
  Initializer initializer_{world_.camera(), {}, SyntheticWorld::OctaveScales()};
  Random random_{1};
  Map map_{SyntheticWorld::OctaveScales()};
  std::vector<SyntheticView> views_;
  std::vector<AnchoredPose> earlier_;
};

TEST_F(InitializerTest, MakesAMapThatIsTrueUpToScale) {
  EXPECT_FALSE(Try(SidewaysPose(0)));
  EXPECT_THAT(initializer_.reason(), HasSubstr("second view"));
  double x = 0;
  while (x < 0.6 && !Try(SidewaysPose(x += 0.05))) {
  }
  ASSERT_EQ(map_.keyframes().size(), 2u) << initializer_.reason();
  EXPECT_THAT(map_.Validate(), IsEmpty());
  EXPECT_NEAR(map_.MedianDepth(KeyframeId(0)), 1, 1e-9);
  EXPECT_GT(map_.landmarks().size(), 200u);

  const Frame& frame = views_.back().frame;
  EXPECT_EQ(frame.reference, KeyframeId(1));
  EXPECT_EQ(frame.cam_from_world.translation,
            map_.keyframes().At(KeyframeId(1)).cam_from_world().translation);
  const double m_per_unit = x / map_.keyframes().At(KeyframeId(1)).CenterInWorld().norm();
  EXPECT_LT((m_per_unit * frame.cam_from_world.translation - Eigen::Vector3d(-x, 0, 0)).norm(), 0.05 * x);
  EXPECT_LT(RotationAngle(frame.cam_from_world.rotation, Eigen::Quaterniond::Identity()), 0.005);
  ASSERT_GE(earlier_.size(), 2u) << "the first view, and those between";
  for (size_t i = 0; i < earlier_.size(); ++i) {
    EXPECT_LE((m_per_unit * earlier_[i].cam_from_reference.translation).norm(), x);
    EXPECT_LT((m_per_unit * earlier_[i].cam_from_reference.translation).tail<2>().norm(), 0.05 * x);
  }
  std::vector<double> errors;
  map_.landmarks().ForEach([&](const Landmark& landmark) {
    const Eigen::Vector3d& truth =
        world_.position(views_.front().points[landmark.observations()[0].keypoint]);
    errors.push_back((m_per_unit * landmark.position() - truth).norm() / truth.z());
  });
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
}

// The median error of depths after a start by a rolling shutter, and the keypoints of both keyframes.
class RollingStart {
 public:
  explicit RollingStart(bool camera_says_so) {
    world_.SetReadout(kReadout_s);
    Camera camera = world_.camera();
    if (!camera_says_so) camera.readout_s = 0;
    Initializer initializer(camera, {}, SyntheticWorld::OctaveScales());
    Random random(1);
    std::vector<SyntheticView> views;
    for (int i = 0; i < 12 && map_.keyframes().size() == 0; ++i) {
      // A step of 0.05 and a turn of 0.02 rad, in a second.
      const Rigid3 pose(ExpSo3({0.02 * i, 0, 0}), {-0.05 * i, 0, 0});
      const Rigid3 next(ExpSo3({0.02 * (i + 1), 0, 0}), {-0.05 * (i + 1), 0, 0});
      views.push_back(world_.See(pose, MotionBetween(next * pose.Inverse(), 1)));
      Frame& frame = views.back().frame;
      for (const Keypoint& keypoint : frame.features.keypoints)
        frame.read_px.emplace_back(keypoint.x, keypoint.y);
      const std::optional<InitialProposal> proposal = initializer.Propose(frame, random);
      if (proposal.has_value() && proposal->is_certain) initializer.BuildMap(*proposal, &frame, &map_);
    }
    if (map_.keyframes().size() == 0) return;
    std::vector<double> ratios, errors;
    map_.landmarks().ForEach([&](const Landmark& landmark) {
      const Observation& seen = landmark.observations()[0];
      const Eigen::Vector3d& truth = world_.position(views.front().points[seen.keypoint]);
      ratios.push_back(landmark.position().z() / truth.z());
      const Keypoint& keypoint = map_.keyframes().At(seen.keyframe).keypoint(seen.keypoint);
      errors.push_back((world_.camera().Project(truth) - Eigen::Vector2d(keypoint.x, keypoint.y)).norm());
    });
    const double scale = MedianOf(&ratios);
    for (double& ratio : ratios) ratio = std::abs(ratio / scale - 1);
    depth_error = MedianOf(&ratios);
    keypoint_error_px = MedianOf(&errors);
  }

  // Keypoints of both keyframes that their grids do not have where they are.
  int Misplaced() const {
    int misplaced = 0;
    map_.keyframes().ForEach([&](const Keyframe& keyframe) {
      for (uint32_t i = 0; i < keyframe.features().size(); ++i) {
        const Keypoint& keypoint = keyframe.keypoint(i);
        bool is_there = false;
        keyframe.grid().ForEachInWindow(keypoint.x, keypoint.y, 0.01f, 0, SyntheticWorld::kOctaves,
                                        [&](uint32_t j) { is_there = is_there || j == i; });
        misplaced += !is_there;
      }
    });
    return misplaced;
  }

  double depth_error = 1, keypoint_error_px = 1000;

 private:
  static constexpr double kReadout_s = 0.7;  // of the second between two views

  static double MedianOf(std::vector<double>* values) {
    std::sort(values->begin(), values->end());
    return (*values)[values->size() / 2];
  }

  SyntheticWorld world_{1500, 0.1};
  Map map_{SyntheticWorld::OctaveScales()};
};

TEST_F(InitializerTest, ARollingShutterThatIsKnownBendsNoStart) {
  const RollingStart known(true), unknown(false);
  EXPECT_LT(known.depth_error, 0.02);
  EXPECT_LT(known.keypoint_error_px, 0.5);
  EXPECT_GT(unknown.keypoint_error_px, 1);
  EXPECT_EQ(known.Misplaced(), 0) << "fusion and loops look for keypoints in the grid";
}

TEST_F(InitializerTest, ARollingShutterStartsFromViewsThatAreSeveralReadoutsApart) {
  // Of views a second apart with steps of 0.15, how many it takes; with what it says before the last.
  const auto views_to_start = [](double readout_s) {
    SyntheticWorld world(1500, 0.1);
    Camera camera = world.camera();
    camera.readout_s = readout_s;
    Initializer initializer(camera, {}, SyntheticWorld::OctaveScales());
    Random random(1);
    std::string reason;
    for (int i = 0; i < 6; ++i) {
      const SyntheticView view = world.See(SidewaysPose(0.15 * i));
      if (initializer.Propose(view.frame, random).has_value()) return std::pair(i + 1, reason);
      reason = initializer.reason();
    }
    return std::pair(7, reason);
  };
  EXPECT_EQ(views_to_start(0.001).first, 3);
  const auto [views, reason] = views_to_start(0.78);  // 3.9 s: between the first view and the fifth are 4
  EXPECT_EQ(views, 5);
  EXPECT_THAT(reason, HasSubstr("3.00 s since the first view < 3.90 s"));
}

TEST_F(InitializerTest, ACameraThatTurnsOnlyWaits) {
  for (int i = 0; i < 12; ++i) EXPECT_FALSE(Try(Rigid3(ExpSo3({0, 0.01 * i, 0}), {0, 0, 0})));
  EXPECT_THAT(initializer_.reason(), HasSubstr("parallax"));
  EXPECT_EQ(map_.keyframes().size(), 0u);
  EXPECT_EQ(map_.landmarks().size(), 0u);
}

TEST_F(InitializerTest, StartsAgainWhenTheFirstViewIsOutOfSight) {
  EXPECT_FALSE(Try(SidewaysPose(0)));
  EXPECT_FALSE(Try(Rigid3(ExpSo3({0, 0.7, 0}), {0, 0, 0})));
  EXPECT_THAT(initializer_.reason(), HasSubstr("starting again from this one"));
}

TEST_F(InitializerTest, AViewFromBetweenTakesOverWhenTheFirstIsOutOfSight) {
  const auto see = [&](int frame) {  // it turns on the spot: no start
    views_.push_back(world_.See(Rigid3(ExpSo3({0, 0.07 * frame, 0}), {0, 0, 0})));
    views_.back().frame.id = FrameId(static_cast<uint32_t>(frame));
    return initializer_.Propose(views_.back().frame, random_).has_value();
  };
  int frame = 0;
  ASSERT_FALSE(see(frame));
  while (initializer_.reference() == FrameId(0) && frame < 12) ASSERT_FALSE(see(++frame));
  EXPECT_GT(initializer_.reference(), FrameId(0));
  EXPECT_LT(initializer_.reference(), FrameId(static_cast<uint32_t>(frame)));
}

TEST_F(InitializerTest, AStartWaitsUntilTheDetectorHasToldOfItsFirstView) {
  const auto see = [&](double x, FrameId untold_from) {
    views_.push_back(world_.See(SidewaysPose(x)));
    return initializer_.Propose(views_.back().frame, random_, untold_from).has_value();
  };
  double x = 0;
  while (x < 0.5) EXPECT_FALSE(see(x += 0.05, FrameId(0)));
  EXPECT_THAT(initializer_.reason(), HasSubstr("waiting for the detector's answer"));
  EXPECT_TRUE(see(x, FrameId(1))) << initializer_.reason();
}

TEST_F(InitializerTest, TooFewKeypointsAreNoFirstView) {
  SyntheticWorld poor(60);
  SyntheticView view = poor.See(Rigid3());
  EXPECT_FALSE(Start(&view.frame));
  EXPECT_THAT(initializer_.reason(), HasSubstr(std::to_string(view.points.size()) + " keypoints < 100"));
  EXPECT_FALSE(Try(SidewaysPose(0)));
  EXPECT_THAT(initializer_.reason(), HasSubstr("second view")) << "the poor view is not kept";
}

}  // namespace
}  // namespace dynamic_slam
