#include "dynamic_slam/semantics/paper_compensation.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/semantics/compensation_test_scene.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

class PaperCompensationTest : public testing::Test {
 protected:
  PaperCompensation paper_{PaperCompensationOptions(), TestCamera()};
  Feed feed_{&paper_};
};

TEST_F(PaperCompensationTest, HoldsABoxOfConstantVelocityForTwoMissesAndGivesUpAtTheThird) {
  for (int i = 0; i < 4; ++i) {
    const auto boxes = feed_.See({{At(100 + 8 * i, 100 - 3 * i)}});
    ASSERT_THAT(boxes, SizeIs(1));
    EXPECT_TRUE(boxes[0].is_detected);
    EXPECT_EQ(boxes[0].track_id, 0);
    EXPECT_EQ(boxes[0].age_frames, i + 1);
  }
  for (int miss = 1; miss <= 2; ++miss) {
    const auto boxes = feed_.See(std::vector<Detection>());
    ASSERT_THAT(boxes, SizeIs(1));
    EXPECT_FALSE(boxes[0].is_detected);
    EXPECT_EQ(boxes[0].missed_frames, miss);
    EXPECT_DOUBLE_EQ(boxes[0].box.x, 124 + 8 * miss);  // Eq. (6)
    EXPECT_DOUBLE_EQ(boxes[0].box.y, 91 - 3 * miss);
    EXPECT_DOUBLE_EQ(boxes[0].box.width, 100);
    EXPECT_DOUBLE_EQ(boxes[0].box.height, 200);
  }
  EXPECT_THAT(feed_.See(std::vector<Detection>()), IsEmpty());
}

TEST_F(PaperCompensationTest, NoResultIsAMiss) {
  feed_.See({{At(100, 100)}});
  EXPECT_THAT(feed_.See(std::nullopt), SizeIs(1));
  EXPECT_THAT(feed_.See(std::nullopt), SizeIs(1));
  EXPECT_THAT(feed_.See(std::nullopt), IsEmpty());
}

TEST_F(PaperCompensationTest, AHitEndsTheRowOfMisses) {
  feed_.See({{At(100, 100)}});
  for (int i = 0; i < 3; ++i) {
    feed_.See(std::nullopt);
    feed_.See(std::nullopt);
    const auto boxes = feed_.See({{At(100, 100)}});
    ASSERT_THAT(boxes, SizeIs(1));
    EXPECT_EQ(boxes[0].track_id, 0);
    EXPECT_EQ(boxes[0].missed_frames, 0);
  }
}

TEST_F(PaperCompensationTest, TheVelocityIsTheMeanOverTheLastKDisplacements) {
  for (const double x : {100, 101, 103, 106, 110, 115, 121}) feed_.See({{At(x, 100)}});
  // The last five of the displacements 1 2 3 4 5 6 have the mean 4.
  EXPECT_DOUBLE_EQ(feed_.See(std::nullopt)[0].box.x, 125);
}

TEST_F(PaperCompensationTest, TheAreaReachesHalfOfAMaxToEitherSide) {
  feed_.See({{At(100, 100)}});
  EXPECT_THAT(feed_.See({{At(110, 90)}}), SizeIs(1));  // moves on by (10, -10)
  const auto boxes = feed_.See({{At(130.5, 80)}});     // 10.5 px beside the prediction
  ASSERT_THAT(boxes, SizeIs(2));
  EXPECT_FALSE(boxes[0].is_detected);
  EXPECT_DOUBLE_EQ(boxes[0].box.x, 120);
  EXPECT_TRUE(boxes[1].is_detected);
}

TEST(PaperCompensation, AMaxGrowsWithTheWidthAndFallsWithTheSquareOfTheRate) {
  Camera camera = TestCamera();
  camera.width = 1280;  // twice
  camera.fps = 15;      // four times: 80 px to either side
  PaperCompensation paper(PaperCompensationOptions(), camera);
  Feed feed(&paper);
  feed.See({{At(100, 100)}});
  EXPECT_THAT(feed.See({{At(180, 100)}}), SizeIs(1));
  EXPECT_THAT(feed.See({{At(340.5, 100)}}), SizeIs(2));
}

TEST_F(PaperCompensationTest, CrossingBoxesKeepTheirNames) {
  int left = -1, right = -1;
  for (int i = 0; i < 40; ++i) {  // they meet at 250
    const auto boxes = feed_.See({{At(100 + 8 * i, 100), At(400 - 8 * i, 103)}});
    ASSERT_THAT(boxes, SizeIs(2));
    if (i == 0) left = boxes[0].track_id, right = boxes[1].track_id;
    EXPECT_EQ(boxes[0].track_id, left);
    EXPECT_EQ(boxes[1].track_id, right);
    EXPECT_DOUBLE_EQ(boxes[0].box.x, 100 + 8 * i);
  }
}

TEST_F(PaperCompensationTest, ClassesAreNotMixed) {
  feed_.See({{At(100, 100, kPerson)}});
  const auto boxes = feed_.See({{At(100, 100, kCar)}});
  ASSERT_THAT(boxes, SizeIs(2));
  EXPECT_EQ(boxes[0].class_id, kPerson);
  EXPECT_FALSE(boxes[0].is_detected);
  EXPECT_EQ(boxes[1].class_id, kCar);
}

TEST_F(PaperCompensationTest, ABoxThatLeavesTheImageEnds) {
  for (int i = 0; i < 10; ++i) feed_.See({{{{45.0 - 5 * i, 100, 8, 50}, kPerson, 0.9}}});  // at 0 to 8
  ASSERT_THAT(feed_.See(std::nullopt), SizeIs(1));
  EXPECT_THAT(feed_.See(std::nullopt), IsEmpty());
}

TEST_F(PaperCompensationTest, ALateResultIsAsGoodAsOneInTime) {
  PaperCompensation in_time(PaperCompensationOptions(), TestCamera());
  Feed feed(&in_time);
  std::vector<CompensatedBox> wanted;
  for (int i = 0; i < 6; ++i) {
    const std::vector<Detection> seen = {At(100 + 5 * i, 100)};
    feed_.See(i < 4 ? std::nullopt : std::optional(seen));
    wanted = feed.See(seen);
  }
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(paper_.UpdateLate(FrameId(i), {{At(100 + 5 * i, 100)}}));
  const auto boxes = paper_.Boxes();
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_DOUBLE_EQ(boxes[0].box.x, wanted[0].box.x);
  EXPECT_EQ(boxes[0].age_frames, 6);
  EXPECT_FALSE(paper_.UpdateLate(FrameId(99), {}));
}

TEST_F(PaperCompensationTest, FramesMustGrowAndResetForgets) {
  feed_.See({{At(100, 100)}});
  EXPECT_THROW(paper_.Update({FrameId(0), 0, std::nullopt, std::nullopt, {}}), InternalError);
  paper_.Reset();
  EXPECT_THAT(paper_.Boxes(), IsEmpty());
  EXPECT_THAT(paper_.Update({FrameId(0), 0, std::nullopt, std::nullopt, {}}), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
