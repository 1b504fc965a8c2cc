#include "dynamic_slam/semantics/dynamic_score.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"

namespace dynamic_slam {
namespace {

constexpr int kMover = 0, kThing = 1;

// Two classes, of score 10 and 0, and numbers that can be worked out by hand.
DynamicScore TwoClasses() {
  DynamicScoreOptions options;
  options.label_evidence = std::log(4.0);
  options.swap_probability = 0.02;
  return DynamicScore(options, {10, 0});
}

CompensatedBox BoxOf(int track_id, int class_id, double trust = 1, int missed_frames = 0) {
  return {{10, 20, 30, 40}, class_id, trust, track_id, missed_frames == 0, 1, missed_frames};
}

double ProbabilityAfter(DynamicScore* score, const CompensatedBox& box) {
  return score->Update(std::vector<CompensatedBox>{box}).at(0).probability;
}

TEST(DynamicScoreTest, FollowsTheEquations) {
  DynamicScore score = TwoClasses();
  // b_0 = (1, 0), Eq. (9): 0.98 * 1 + 0.02 / 2.
  EXPECT_NEAR(ProbabilityAfter(&score, BoxOf(7, kMover)), 0.99, 1e-12);
  // Eq. (9): 0.98 * 0.99 + 0.01 = 0.9802. Eq. (7): odds 0.9802 * 4 : 0.0198.
  EXPECT_NEAR(ProbabilityAfter(&score, BoxOf(7, kMover)), 3.9208 / 3.9406, 1e-12);

  score = TwoClasses();
  ProbabilityAfter(&score, BoxOf(7, kMover));
  // A contradiction: 0.9802 : 0.0198 * 4. With half of the trust: * 2.
  EXPECT_NEAR(ProbabilityAfter(&score, BoxOf(7, kThing)), 0.9802 / 1.0594, 1e-12);
  score = TwoClasses();
  ProbabilityAfter(&score, BoxOf(7, kMover));
  EXPECT_NEAR(ProbabilityAfter(&score, BoxOf(7, kThing, 0.5)), 0.9802 / 1.0198, 1e-12);
}

TEST(DynamicScoreTest, ResultsCarryTheirBoxes) {
  DynamicScore score = TwoClasses();
  const auto boxes = score.Update(std::vector{BoxOf(3, kMover), BoxOf(5, kThing)});
  ASSERT_EQ(boxes.size(), 2u);
  EXPECT_EQ(boxes[0].track_id, 3);
  EXPECT_EQ(boxes[0].box.width, 30);
  EXPECT_NEAR(boxes[0].dynamic_score, 9.9, 1e-12);
  EXPECT_TRUE(boxes[0].is_dynamic);
  EXPECT_NEAR(boxes[1].dynamic_score, 0.1, 1e-12);
  EXPECT_FALSE(boxes[1].is_dynamic);
  EXPECT_TRUE(score.Update({}).empty());
}

// The classes of COCO in miniature: 80 classes, of which 0 is a person, 1 a car, 2 a chair, 3 a dog.
class ManyClasses : public testing::Test {
 protected:
  ManyClasses() : scores_(80, 2.0), score_(DynamicScoreOptions(), WithNames()) {}

  std::vector<double> WithNames() {
    scores_[kPerson] = 10;
    scores_[kCar] = 6;
    scores_[kChair] = 3;
    scores_[kDog] = 9;
    return scores_;
  }

  DynamicBox See(int class_id, int times, double trust = 0.8) {
    DynamicBox box;
    for (int i = 0; i < times; ++i) {
      box = score_.Update(std::vector{BoxOf(1, class_id, trust)}).at(0);
    }
    return box;
  }

  static constexpr int kPerson = 0, kCar = 1, kChair = 2, kDog = 3;
  std::vector<double> scores_;
  DynamicScore score_;
};

TEST_F(ManyClasses, TheFirstDetectionDecidesByItsClass) {
  for (const auto& [class_id, is_dynamic] : {std::pair(kPerson, true), {kCar, true}, {kChair, false}}) {
    score_.Reset();
    const DynamicBox box = See(class_id, 1, 0.4);
    EXPECT_EQ(box.is_dynamic, is_dynamic) << class_id;
    EXPECT_NEAR(box.dynamic_score, scores_[static_cast<size_t>(class_id)], 0.2);
  }
}

TEST_F(ManyClasses, ACarThatIsSeenAHundredTimesIsStillACar) { EXPECT_NEAR(See(kCar, 100).dynamic_score, 6, 0.1); }

TEST_F(ManyClasses, AFewWrongLabelsDoNotFlipALastingChangeDoes) {
  See(kPerson, 10);
  EXPECT_GT(See(kChair, 3).dynamic_score, 9);
  EXPECT_GT(See(kPerson, 3).dynamic_score, 9.8);
  const DynamicBox chair = See(kChair, 15);
  EXPECT_NEAR(chair.dynamic_score, 3, 0.3);
  EXPECT_FALSE(chair.is_dynamic);
  EXPECT_TRUE(See(kPerson, 15).is_dynamic) << "and back";
}

TEST_F(ManyClasses, AFlipBetweenMoversIsNoFlip) {
  for (int i = 0; i < 10; ++i) {
    EXPECT_GT(See(kPerson, 1).dynamic_score, 8.5);
    EXPECT_GT(See(kDog, 1).dynamic_score, 8.5);
  }
}

TEST_F(ManyClasses, AMissedDetectionChangesNothing) {
  const double seen = See(kPerson, 5).dynamic_score;
  for (int missed = 1; missed <= 30; ++missed) {
    const auto boxes = score_.Update(std::vector{BoxOf(1, kPerson, 0.3, missed)});
    EXPECT_EQ(boxes.at(0).dynamic_score, seen);
  }
}

TEST(DynamicScoreTest, ALateDetectionCountsOnce) {
  DynamicScore late = TwoClasses(), in_time = TwoClasses();
  ProbabilityAfter(&in_time, BoxOf(1, kMover));
  const double expected = ProbabilityAfter(&in_time, BoxOf(1, kThing));

  ProbabilityAfter(&late, BoxOf(1, kMover));                            // frame 1, detected
  ProbabilityAfter(&late, BoxOf(1, kMover, 1, 1));                      // frame 2: no result yet
  const double told = ProbabilityAfter(&late, BoxOf(1, kThing, 1, 1));  // frame 3: that of frame 2 is here
  EXPECT_NEAR(told, expected, 1e-12);
  EXPECT_EQ(ProbabilityAfter(&late, BoxOf(1, kThing, 1, 2)), told);
}

TEST(DynamicScoreTest, TracksAreApartAndForgottenLongAfterTheirEnd) {
  DynamicScore score = TwoClasses();
  const auto history = static_cast<int>(BoxCompensation::kHistoryFrames);
  for (int i = 0; i < 5; ++i) ProbabilityAfter(&score, BoxOf(1, kMover));
  const double known = ProbabilityAfter(&score, BoxOf(1, kMover, 1, 1));
  EXPECT_NEAR(ProbabilityAfter(&score, BoxOf(2, kThing)), 0.01, 1e-12) << "a new track starts by itself";
  EXPECT_EQ(score.size(), 2u);
  // A late result brings track 1 back, with what was known of it.
  EXPECT_EQ(ProbabilityAfter(&score, BoxOf(1, kMover, 1, 3)), known);
  for (int i = 0; i < history; ++i) score.Update({});
  EXPECT_EQ(score.size(), 0u);

  ProbabilityAfter(&score, BoxOf(3, kMover));
  score.Reset();
  EXPECT_EQ(score.size(), 0u);
}

TEST(DynamicScoreTest, TheThresholdIsAnOptionAndMustBeExceeded) {
  DynamicScoreOptions options;
  for (const auto& [threshold, is_dynamic] : {std::pair(3.9, true), {4.0, false}, {5.0, false}}) {
    options.threshold = threshold;
    DynamicScore score(options, {4});
    EXPECT_EQ(score.Update(std::vector{BoxOf(1, 0)}).at(0).is_dynamic, is_dynamic) << threshold;
  }
}

TEST(DynamicScoreTest, NonsenseIsABug) {
  EXPECT_TRUE(DynamicScore({}, {}).Update({}).empty());  // a table without boxes has no classes
  EXPECT_THROW(DynamicScore({}, {11}), InternalError);
  EXPECT_THROW(DynamicScore({}, {std::nan("")}), InternalError);
  DynamicScore score = TwoClasses();
  EXPECT_THROW(score.Update(std::vector{BoxOf(1, 2)}), InternalError);
  EXPECT_THROW(score.Update(std::vector{BoxOf(1, -1)}), InternalError);
  EXPECT_THROW(score.Update(std::vector{BoxOf(1, 0, std::nan(""))}), InternalError);
}

TEST(DynamicScoreTest, OptionsAreInTheirRanges) { CheckOptions(DynamicScoreOptions()); }

}  // namespace
}  // namespace dynamic_slam
