#include "dynamic_slam/tracking/unconfirmed_poses.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

FrameObjects Told(FrameId to, FrameId untold_from) {
  FrameObjects objects;
  objects.told_to = to;
  objects.untold_from = untold_from;
  return objects;
}

TEST(UnconfirmedPoses, TheNextFrameConfirmsWhereTheDetectorIsOnTime) {
  for (const FrameObjects& objects : {FrameObjects(), Told(FrameId(8), FrameId())}) {
    UnconfirmedPoses unconfirmed;
    unconfirmed.Add(FrameId(7), true, objects);
    EXPECT_TRUE(unconfirmed.Any());
    unconfirmed.Add(FrameId(8), false, objects);
    EXPECT_FALSE(unconfirmed.Any());
    unconfirmed.Add(FrameId(9), false, objects);
    EXPECT_EQ(unconfirmed.Withdraw(), 0);
  }
}

TEST(UnconfirmedPoses, ALateAnswerAboutTheFrameThatWasFoundOrALaterOneConfirms) {
  UnconfirmedPoses unconfirmed;
  unconfirmed.Add(FrameId(7), true, Told(FrameId(), FrameId(1)));
  unconfirmed.Add(FrameId(8), false, Told(FrameId(), FrameId(1)));
  unconfirmed.Add(FrameId(9), false, Told(FrameId(1), FrameId(9)));
  EXPECT_TRUE(unconfirmed.Any()) << "who came after frame 1 is not known";
  unconfirmed.Add(FrameId(10), false, Told(FrameId(9), FrameId(10)));
  EXPECT_FALSE(unconfirmed.Any());
}

TEST(UnconfirmedPoses, AllSinceTheOneThatWasFoundAreWithdrawn) {
  UnconfirmedPoses unconfirmed;
  for (uint32_t i = 7; i < 10; ++i) unconfirmed.Add(FrameId(i), i == 7, Told(FrameId(1), FrameId(6)));
  EXPECT_EQ(unconfirmed.Withdraw(), 3);
  EXPECT_FALSE(unconfirmed.Any());
  EXPECT_EQ(unconfirmed.Withdraw(), 0);
  unconfirmed.Add(FrameId(20), true, Told(FrameId(6), FrameId(20)));
  EXPECT_EQ(unconfirmed.Withdraw(), 1) << "counted anew";
}

}  // namespace
}  // namespace dynamic_slam
