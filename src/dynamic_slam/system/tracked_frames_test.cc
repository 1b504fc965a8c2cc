#include "dynamic_slam/system/tracked_frames.h"

#include <cmath>
#include <span>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

// A camera that goes sideways at a unit a second, with ten frames a second, every tenth of them a keyframe.
class TrackedFramesTest : public testing::Test {
 protected:
  static constexpr double kInterval_s = 0.1, kAway = 3;

  static double Stamp(size_t frame) { return kInterval_s * static_cast<double>(frame); }

  // So many frames, each on the keyframe before it; the map has those from first_moved to last_moved, and not
  // that one, elsewhere.
  void Go(size_t frames, size_t first_moved, size_t last_moved) {
    for (size_t i = 0; i < frames; ++i) {
      const bool is_moved = i >= first_moved && i < last_moved;
      const Rigid3 cam_from_world = SidewaysPose(Stamp(i) + (is_moved ? kAway : 0));
      const auto map = map_.Write();
      if (i % 10 == 0) {
        SyntheticView view = world_.See(cam_from_world);
        view.frame.timestamp_s = Stamp(i);
        keyframes_.push_back(InsertKeyframe(view.frame, map.get()));
      }
      const Rigid3 cam_from_keyframe =
          cam_from_world * map->keyframes().At(keyframes_.back()).cam_from_world().Inverse();
      tracked_.Add({Stamp(i), keyframes_.back(), cam_from_keyframe}, true);
    }
  }

  // Of frames of the part, where they are along the way.
  void ExpectPath(PartId part, size_t first, size_t last, double moved_by) {
    const Trajectory path = tracked_.PathOf(part);
    ASSERT_EQ(path.size(), last - first);
    for (size_t i = 0; i < path.size(); ++i) {
      EXPECT_DOUBLE_EQ(path[i].timestamp_s, Stamp(first + i));
      EXPECT_NEAR(path[i].world_from_cam.translation.x(), Stamp(first + i) + moved_by, 1e-5);
    }
  }

  SyntheticWorld world_{100};
  SharedMap map_{SyntheticWorld::OctaveScales()};
  TrackedFrames tracked_{&map_};
  std::vector<KeyframeId> keyframes_;
};

TEST_F(TrackedFramesTest, APathWithoutLeapsStaysWhole) {
  Go(100, 100, 100);
  EXPECT_THAT(tracked_.PiecesAtLeaps(), IsEmpty());
  ExpectPath(PartId(0), 0, 100, 0);
}

TEST_F(TrackedFramesTest, FramesMoveToWhereTheirViewsAre) {
  Go(30, 30, 30);
  std::vector<FrameView> views;
  for (const size_t i : {3u, 10u, 17u})
    views.push_back({Stamp(i), PartId(0), SidewaysPose(Stamp(i) + 1), {}});
  views[1].part = PartId(1);  // it has left that
  tracked_.Move(views);
  const Trajectory path = tracked_.PathOf(PartId(0));
  ASSERT_EQ(path.size(), 30u);
  for (size_t i = 0; i < path.size(); ++i) {
    EXPECT_NEAR(path[i].world_from_cam.translation.x(), Stamp(i) + (i == 3 || i == 17 ? 1 : 0), 1e-5) << i;
  }
}

TEST_F(TrackedFramesTest, WhatLiesBeforeALeapBecomesAPartOfItsOwn) {
  Go(100, 0, 18);
  // From frame 18 on the camera is elsewhere; 18 and 19 hang on the keyframe of before.
  const std::vector<TrackedFrames::Piece> pieces = tracked_.PiecesAtLeaps();
  const std::vector<PartId> cut = tracked_.CutOff(pieces);
  ASSERT_EQ(cut.size(), 1u);
  EXPECT_EQ(tracked_.Parts(), (std::vector{PartId(0), cut[0]}));
  ExpectPath(PartId(0), 18, 100, 0);
  ExpectPath(cut[0], 0, 18, kAway);
  EXPECT_EQ(tracked_.LiveCountOf(PartId(0)), 82u);
  const auto map = map_.Read();
  EXPECT_EQ(map->keyframes().At(keyframes_[1]).part(), cut[0]);
  EXPECT_EQ(map->keyframes().At(keyframes_[2]).part(), PartId(0));
  EXPECT_THAT(map->Validate(), IsEmpty());
}

TEST_F(TrackedFramesTest, APieceBetweenLeapsIsCutOut) {
  Go(100, 45, 56);
  const std::vector<TrackedFrames::Piece> pieces = tracked_.PiecesAtLeaps();
  const std::vector<PartId> cut = tracked_.CutOff(pieces);
  ASSERT_EQ(cut.size(), 1u);
  ExpectPath(cut[0], 45, 56, kAway);
  EXPECT_EQ(tracked_.PathOf(PartId(0)).size(), 89u);
  EXPECT_THAT(map_.Read()->Validate(), IsEmpty());
}

TEST_F(TrackedFramesTest, APieceWithoutKeyframeStays) {
  Go(100, 41, 50);
  const std::vector<TrackedFrames::Piece> pieces = tracked_.PiecesAtLeaps();
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_THAT(tracked_.CutOff(pieces), IsEmpty());
  EXPECT_EQ(tracked_.PathOf(PartId(0)).size(), 100u);
}

TEST_F(TrackedFramesTest, APieceIsWrongWhereItsFramesAreFoundElsewhere) {
  Go(100, 0, 18);
  const std::vector<TrackedFrames::Piece> pieces = tracked_.PiecesAtLeaps();
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].centres.size(), 18u);
  ASSERT_EQ(tracked_.CutOff(pieces).size(), 1u);
  const auto found = [&](size_t count, double away) {
    std::vector<AnchoredPose> poses;
    for (size_t i = 0; i < count; ++i) {
      const Rigid3 pose = SidewaysPose(Stamp(i) + kAway + away);
      poses.push_back({Stamp(i), keyframes_[5], map_.Read()->CamFromReference(keyframes_[5], pose)});
    }
    return poses;
  };
  // The camera can have moved by 0.2 from one frame to the next.
  EXPECT_TRUE(tracked_.IsWrong(pieces[0], found(12, -kAway)));
  EXPECT_TRUE(tracked_.IsWrong(pieces[0], found(12, 0.25)));
  EXPECT_FALSE(tracked_.IsWrong(pieces[0], found(12, 0.15))) << "a cut of the film";
  EXPECT_FALSE(tracked_.IsWrong(pieces[0], found(4, -kAway))) << "fewer than a quarter";
  EXPECT_FALSE(tracked_.IsWrong(pieces[0], {}));
  std::vector<AnchoredPose> mixed = found(12, 0);
  for (size_t i = 0; i < 6; ++i) mixed[i] = found(12, -kAway)[i];
  EXPECT_FALSE(tracked_.IsWrong(pieces[0], mixed));
}

TEST_F(TrackedFramesTest, AnEndAtALeapIsWrongWhereThePathLeapsNoMoreWithoutIt) {
  Go(100, 36, 42);
  EXPECT_THAT(tracked_.EndsAtLeaps(0.05, true), IsEmpty()) << "no frame is so near";
  const std::vector<TrackedFrames::Piece> ends = tracked_.EndsAtLeaps(1.0, true);
  ASSERT_THAT(ends, SizeIs(2));
  const TrackedFrames::Piece& end = ends[1];
  EXPECT_LE(end.centres.begin()->first, Stamp(36));
  EXPECT_GE(end.centres.rbegin()->first, Stamp(41));
  EXPECT_LE(end.centres.rbegin()->first, Stamp(43)) << "a smooth path leaps in several steps";
  const std::vector<TrackedFrames::Piece> after = tracked_.EndsAtLeaps(1.0, false);
  ASSERT_THAT(after, SizeIs(2));
  EXPECT_GT(after[1].centres.begin()->first, Stamp(38));
  ASSERT_EQ(tracked_.CutOff(std::span(&end, 1)).size(), 1u);
  // All but some of them, each so far from its place.
  const auto found = [&](size_t without, double away) {
    std::vector<AnchoredPose> poses;
    for (const auto& [timestamp_s, centre] : end.centres) {
      if (poses.size() + without == end.centres.size()) break;
      const Rigid3 pose = SidewaysPose(timestamp_s + away);
      poses.push_back({timestamp_s, keyframes_[5], map_.Read()->CamFromReference(keyframes_[5], pose)});
    }
    return poses;
  };
  EXPECT_TRUE(tracked_.IsWrong(end, found(0, 0)));
  EXPECT_TRUE(tracked_.IsWrong(end, found(2, 0)));
  EXPECT_FALSE(tracked_.IsWrong(end, found(4, 0))) << "too many of them would have no pose";
  EXPECT_FALSE(tracked_.IsWrong(end, found(0, kAway))) << "it leaps as before";
  EXPECT_FALSE(tracked_.IsWrong(end, {}));
  const size_t frames = tracked_.PathOf(PartId(0)).size(), live = tracked_.LiveCountOf(PartId(0));
  const std::vector<AnchoredPose> mended = found(2, 0);
  tracked_.RemoveAllBut(mended, end);
  tracked_.Replace(mended);
  EXPECT_THAT(tracked_.Parts(), SizeIs(1)) << "none is left on the part that was cut off";
  EXPECT_EQ(tracked_.PathOf(PartId(0)).size(), frames + mended.size());
  EXPECT_EQ(tracked_.LiveCountOf(PartId(0)), live + mended.size()) << "tracked then, and once more now";
}

TEST_F(TrackedFramesTest, OfTwoHalvesNobodyCanTellWhichStandsWrong) {
  Go(100, 0, 45);
  EXPECT_THAT(tracked_.PiecesAtLeaps(), IsEmpty());
  EXPECT_EQ(tracked_.PathOf(PartId(0)).size(), 100u);
}

TEST_F(TrackedFramesTest, WhatIsFoundReplacesWhatIsGivenUp) {
  Go(100, 100, 100);
  const AnchoredPose found{Stamp(7), keyframes_[1], SidewaysPose(0.25)},
      later{Stamp(200), keyframes_[1], Rigid3()};
  tracked_.AddFound(std::vector{later, found});
  const Trajectory path = tracked_.PathOf(PartId(0));
  ASSERT_EQ(path.size(), 101u);
  EXPECT_NEAR(path[7].world_from_cam.translation.x(), Stamp(10) + 0.25, 1e-5);
  EXPECT_DOUBLE_EQ(path[100].timestamp_s, Stamp(200));
  EXPECT_EQ(tracked_.LiveCountOf(PartId(0)), 99u);
  const Trajectory live = tracked_.LivePathOf(PartId(0));
  ASSERT_EQ(live.size(), 99u);
  EXPECT_DOUBLE_EQ(live[6].timestamp_s, Stamp(6));
  EXPECT_DOUBLE_EQ(live[7].timestamp_s, Stamp(8)) << "the one that was found is not among them";
  EXPECT_DOUBLE_EQ(live[98].timestamp_s, Stamp(99));
}

}  // namespace
}  // namespace dynamic_slam
