#include "dynamic_slam/tracking/late_judgement.h"

#include <gtest/gtest.h>

#include "dynamic_slam/map/static_evidence.h"
#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kOldPoints = 300, kPoints = 600;

// Four keyframes of a camera that moves sideways. The first two see half of the points as landmarks, the last
// two all: the other half was made since.
class LateJudgementTest : public ::testing::Test {
 protected:
  LateJudgementTest() {
    for (int i = 0; i < 4; ++i) {
      keyframes_.push_back(scene_.Add(SidewaysPose(0.05 * i)));
      judgement_.Remember(FrameOf(i), keyframes_.back());
    }
    scene_.AddLandmarks(0, kOldPoints, {keyframes_[0], keyframes_[1]});
    scene_.AddLandmarks(kOldPoints, kPoints, {keyframes_[2], keyframes_[3]});
  }

  FrameId FrameOf(int keyframe) const { return scene_.views[static_cast<size_t>(keyframe)].frame.id; }

  static LateObjects Person(FrameId frame) {
    DynamicBox box;
    box.box = {200, 100, 240, 300};
    box.probability = 0.97;
    box.is_dynamic = true;
    return {frame, {box}};
  }

  void Tell(const std::vector<LateObjects>& late) {
    judgement_.Judge(late, filter_, &initializer_, &scene_.shared_map);
  }

  // Landmarks of points from `first` on, that a keyframe sees in or outside the person's box.
  int Count(int keyframe, uint32_t first, bool inside) const {
    const Box box = Person(FrameId(0)).boxes[0].box;
    int count = 0;
    const Keyframe& seen_by = scene_.map.keyframes().At(keyframes_[static_cast<size_t>(keyframe)]);
    for (uint32_t i = 0; i < seen_by.landmarks().size(); ++i) {
      if (!seen_by.landmarks()[i].IsValid()) continue;
      if (scene_.views[static_cast<size_t>(keyframe)].points[i] < first) continue;
      const Keypoint& keypoint = seen_by.keypoint(i);
      // Beside the outline it may be either.
      if (inside ? box.Contains(keypoint.raw_x, keypoint.raw_y)
                 : !box.Contains(keypoint.raw_x, keypoint.raw_y, 60)) {
        ++count;
      }
    }
    return count;
  }

  SyntheticWorld world_{static_cast<int>(kPoints)};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_;
  DynamicFilter filter_{world_.camera(), {}, SyntheticWorld::OctaveScales()};
  Initializer initializer_{world_.camera(), {}, SyntheticWorld::OctaveScales()};
  LateJudgement judgement_;
};

TEST_F(LateJudgementTest, LandmarksThatWereMadeOfAPersonAreErased) {
  const int old_inside = Count(1, 0, true), outside = Count(3, kOldPoints, false);
  ASSERT_GT(Count(3, kOldPoints, true), 20);
  ASSERT_GT(old_inside, 20);
  ASSERT_GT(outside, 20);
  Tell({Person(FrameOf(2)), Person(FrameOf(3))});
  EXPECT_EQ(Count(3, kOldPoints, true), 0);
  EXPECT_EQ(Count(3, kOldPoints, false), outside);
  EXPECT_EQ(Count(1, 0, true), old_inside) << "made before the person came";
  EXPECT_TRUE(scene_.map.Validate().empty());
}

TEST_F(LateJudgementTest, KeypointsOfAPersonMakeNoLandmarksAnyMore) {
  Tell({Person(FrameOf(2))});
  const Box box = Person(FrameId(0)).boxes[0].box;
  const Keyframe &told = scene_.map.keyframes().At(keyframes_[2]),
                 &other = scene_.map.keyframes().At(keyframes_[3]);
  int inside = 0;
  for (uint32_t i = 0; i < told.features().size(); ++i) {
    if (!box.Contains(told.keypoint(i).raw_x, told.keypoint(i).raw_y)) continue;
    EXPECT_LT(told.StaticProbability(i), kMinStaticProbability);
    ++inside;
  }
  EXPECT_GT(inside, 20);
  for (uint32_t i = 0; i < other.features().size(); ++i) EXPECT_EQ(other.StaticProbability(i), 1);
}

TEST_F(LateJudgementTest, AfterAResetNothingIsKnownOfKeyframes) {
  const size_t landmarks = scene_.map.landmarks().size();
  judgement_.Reset();
  Tell({Person(FrameOf(2)), Person(FrameOf(3))});
  EXPECT_EQ(scene_.map.landmarks().size(), landmarks);
}

TEST_F(LateJudgementTest, AFirstViewDoesWithoutThePerson) {
  Random random(1);
  SyntheticView view = world_.See(SidewaysPose(0.3));
  initializer_.Propose(view.frame, random);
  ASSERT_EQ(initializer_.reference(), view.frame.id);
  Tell({Person(view.frame.id)});
  const Box box = Person(FrameId(0)).boxes[0].box;
  int inside = 0, used = 0;
  initializer_.ForEachReference([&](const Frame* reference) {
    for (uint32_t i = 0; i < reference->features.size(); ++i) {
      const Keypoint& keypoint = reference->features.keypoints[i];
      const bool is_used = !reference->MovesForSure(i);
      used += is_used;
      if (!box.Contains(keypoint.raw_x, keypoint.raw_y)) continue;
      EXPECT_FALSE(is_used);
      ++inside;
    }
  });
  EXPECT_GT(inside, 20);
  EXPECT_GT(used, 100);
}

}  // namespace
}  // namespace dynamic_slam
