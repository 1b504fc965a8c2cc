#include "dynamic_slam/viewer/player_command.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

TEST(PlayerCommandTest, WhatABrowserSays) {
  using Kind = PlayerCommand::Kind;
  EXPECT_EQ(ParsePlayerCommand("pause")->kind, Kind::kPause);
  EXPECT_EQ(ParsePlayerCommand("resume")->kind, Kind::kResume);
  EXPECT_EQ(ParsePlayerCommand("step")->kind, Kind::kStep);
  const auto seek = ParsePlayerCommand("seek 12"), speed = ParsePlayerCommand("speed 0.5");
  ASSERT_TRUE(seek.has_value() && speed.has_value());
  EXPECT_EQ(seek->kind, Kind::kSeek);
  EXPECT_EQ(seek->number, 12);
  EXPECT_EQ(speed->kind, Kind::kSpeed);
  EXPECT_EQ(speed->number, 0.5);
}

TEST(PlayerCommandTest, AllElseIsIgnored) {
  for (const char* text : {"", " ", "stop", "seek", "seek ", "seek -1", "seek nan", "seek 1e9", "seek 1 2",
                           "speed 0", "speed 21", "speed inf", "pause 1", " pause"}) {
    EXPECT_FALSE(ParsePlayerCommand(text).has_value()) << text;
  }
}

}  // namespace
}  // namespace dynamic_slam
