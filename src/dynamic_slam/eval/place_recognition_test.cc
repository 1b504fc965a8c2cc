#include "dynamic_slam/eval/place_recognition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

using Truth = PlaceAnswer::Truth;

TEST(PlaceRecognitionTest, TheCurveOfAHandfulOfAnswers) {
  // Four questions with a right answer, one of which nothing looks like; an unclear answer counts as none.
  const std::vector<PlaceAnswer> answers{{true, 0.9, Truth::kRight},    {true, 0.5, Truth::kRight},
                                         {false, 0.4, Truth::kWrong},   {true, 0.3, Truth::kRight},
                                         {false, 0.7, Truth::kUnclear}, {true, std::nullopt, Truth::kWrong}};
  const std::vector<PrecisionRecall> curve = PrecisionRecallCurve(answers);
  ASSERT_EQ(curve.size(), 4u);
  const double expected[][3] = {{0.9, 1, 0.25}, {0.5, 1, 0.5}, {0.4, 2.0 / 3, 0.5}, {0.3, 0.75, 0.75}};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(curve[i].min_score, expected[i][0]);
    EXPECT_DOUBLE_EQ(curve[i].precision, expected[i][1]);
    EXPECT_DOUBLE_EQ(curve[i].recall, expected[i][2]);
  }
  EXPECT_DOUBLE_EQ(RecallAtFullPrecision(curve), 0.5);
}

TEST(PlaceRecognitionTest, EqualScoresAreOnePoint) {
  const std::vector<PrecisionRecall> curve =
      PrecisionRecallCurve({{true, 0.5, Truth::kRight}, {true, 0.5, Truth::kWrong}});
  ASSERT_EQ(curve.size(), 1u);
  EXPECT_DOUBLE_EQ(curve[0].precision, 0.5);
  EXPECT_DOUBLE_EQ(RecallAtFullPrecision(curve), 0);
}

TEST(PlaceRecognitionTest, WhatNeedNotBeFoundIsNoRecall) {
  const std::vector<PrecisionRecall> curve =
      PrecisionRecallCurve({{true, 0.5, Truth::kWrong}, {false, 0.6, Truth::kRight}});
  ASSERT_EQ(curve.size(), 2u);
  EXPECT_DOUBLE_EQ(curve[0].precision, 1);
  EXPECT_DOUBLE_EQ(curve[0].recall, 0);
}

TEST(PlaceRecognitionTest, WithoutAPlaceSeenTwiceThereIsNoCurve) {
  EXPECT_TRUE(PrecisionRecallCurve({{false, 0.5, Truth::kWrong}}).empty());
  EXPECT_DOUBLE_EQ(RecallAtFullPrecision({}), 0);
}

}  // namespace
}  // namespace dynamic_slam
