#include "dynamic_slam/base/text.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::filesystem::path TestFolder() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / (std::string("dynamic_slam_text_") + test->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

TEST(EditDistance, KnownAnswers) {
  EXPECT_EQ(EditDistance("", ""), 0);
  EXPECT_EQ(EditDistance("", "abc"), 3);
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3);
  EXPECT_EQ(EditDistance("feautres", "features"), 1);  // two neighbours swapped
  EXPECT_EQ(EditDistance("fx", "fy"), 1);
}

TEST(ClosestName, FindsMisspellingsOnly) {
  const std::vector<std::string> names = {"orb.features", "tracker.min_inliers", "fx"};
  EXPECT_EQ(ClosestName("orb.feautres", names), "orb.features");
  EXPECT_EQ(ClosestName("min_inliers", names), "tracker.min_inliers");
  EXPECT_EQ(ClosestName("f_x", names), "fx");
  EXPECT_EQ(ClosestName("something_else_entirely", names), std::nullopt);
  EXPECT_EQ(ClosestName("ab", names), std::nullopt);
  EXPECT_EQ(DidYouMean("f_x", names), " Did you mean 'fx'?");
  EXPECT_EQ(DidYouMean("ab", names), "");
}

TEST(ParseDouble, TakesWholeNumbersOnly) {
  EXPECT_EQ(ParseDouble("1.5e3"), 1500.0);
  EXPECT_EQ(ParseDouble("+2"), 2.0);
  EXPECT_EQ(ParseDouble("-0.25"), -0.25);
  for (const char* text : {"", " 1", "1 ", "1.5x", "1,5", "+-1", "0x10", "--1"}) {
    EXPECT_EQ(ParseDouble(text), std::nullopt) << text;
  }
}

TEST(ShortestDouble, ReadsBackIdentically) {
  for (const double value : {0.1, 1.0, -3.0, 1e300, 5e-324, 1.0 / 3.0, 1305031452.791720, 0.0}) {
    EXPECT_EQ(ParseDouble(ShortestDouble(value)), value) << ShortestDouble(value);
  }
  EXPECT_EQ(ShortestDouble(2.0), "2.0");
  EXPECT_EQ(ShortestDouble(0.1), "0.1");
}

TEST(SplitColumns, TakesRunsOfSeparatorsAsOne) {
  EXPECT_THAT(SplitColumns("  a\tb  c\r"), ElementsAre("a", "b", "c"));
  EXPECT_THAT(SplitColumns("1,2, 3", ","), ElementsAre("1", "2", "3"));
  EXPECT_TRUE(SplitColumns(" \t").empty());
}

TEST(ReadDataLines, SkipsCommentsAndBlanksAndCountsThem) {
  const auto file = TestFolder() / "a.txt";
  WriteFileAtomically(file, "# comment\n\n first \r\n#\nsecond");
  const std::vector<TextLine> lines = ReadDataLines(file);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].number, 3);
  EXPECT_EQ(lines[0].text, "first");
  EXPECT_EQ(lines[1].number, 5);
  EXPECT_EQ(lines[1].text, "second");
}

TEST(InputError, QuotesNothingThatEndsItOrCommandsATerminal) {
  const std::string quoted("a\0b\x1b[2Jc\xc3\xa9", 10);
  EXPECT_STREQ(InputError("x:1", "'" + quoted + "' is no number", "Correct the line.").what(),
               "x:1: 'a?b?[2Jc\xc3\xa9' is no number\n  Correct the line.");
}

TEST(ReadFile, WhatHasNoEndIsRefused) {
  try {
    ReadFile("/dev/zero", "Give a file.");
    FAIL() << "it has no end";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("/dev/zero: does not end"));
    EXPECT_THAT(e.what(), HasSubstr("Give a file."));
  }
}

TEST(ReadFile, NamesTheFileAndTheReason) {
  const auto folder = TestFolder();
  try {
    ReadFile(folder / "absent.txt", "Check the path.");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("absent.txt"));
    EXPECT_THAT(e.what(), HasSubstr("No such file"));
    EXPECT_THAT(e.what(), HasSubstr("Check the path."));
  }
  EXPECT_THROW(ReadFile(folder), InputError);
}

TEST(WriteFileAtomically, ReplacesAndLeavesNoTemporary) {
  const auto folder = TestFolder();
  const auto file = folder / "new" / "a.txt";
  WriteFileAtomically(file, "one");
  WriteFileAtomically(file, "two");
  EXPECT_EQ(ReadFile(file), "two");
  EXPECT_FALSE(std::filesystem::exists(folder / "new" / "a.txt.tmp"));
}

TEST(WriteFileAtomically, FailsWithTheReason) {
  const auto folder = TestFolder();
  WriteFileAtomically(folder / "file", "x");
  EXPECT_THROW(WriteFileAtomically(folder / "file" / "below.txt", "y"), InputError);
  std::filesystem::create_directories(folder / "taken" / "inside");
  EXPECT_THROW(WriteFileAtomically(folder / "taken", "y"), InputError);
  EXPECT_THROW(CheckCanBeWritten(folder / "file" / "below.txt"), InputError);
  EXPECT_THROW(CheckCanBeWritten(folder / "taken"), InputError);
  CheckCanBeWritten(folder / "new" / "file");
  EXPECT_TRUE(std::filesystem::is_empty(folder / "new"));
  CheckCanBeWritten(folder / "file");
  EXPECT_EQ(ReadFile(folder / "file"), "x");
  EXPECT_FALSE(std::filesystem::exists(folder / "taken.tmp"));
}

}  // namespace
}  // namespace dynamic_slam
