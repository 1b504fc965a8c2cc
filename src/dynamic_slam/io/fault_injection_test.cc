#include "dynamic_slam/io/fault_injection.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Lt;

constexpr int kFrames = 1000;

// 10 images a second; image i has the grey value 50 + i % 150 on its left half, and half of it on its right.
class CountingSource : public FrameSource {
 public:
  std::optional<SourceImage> Next() override {
    if (next_ == kFrames) return std::nullopt;
    if (next_ == 5 && problems_.empty()) problems_.push_back({"4b", "is broken"});
    cv::Mat1b image(4, 6, static_cast<uint8_t>(GreyOf(next_)));
    image.colRange(3, 6) = GreyOf(next_) / 2;
    SourceImage result{100 + 0.1 * next_, image, std::to_string(next_)};
    ++next_;
    return result;
  }
  static int GreyOf(int frame) { return 50 + frame % 150; }
  size_t FrameCount() const override { return kFrames + 1; }
  bool IsLive() const override { return true; }
  std::string EndReason() const override { return next_ == kFrames ? "it was enough" : ""; }
  std::string Layout() const override { return "counting"; }
  std::optional<Camera> OwnCamera() const override { return std::nullopt; }
  cv::Size ImageSize() const override { return {6, 4}; }
  const std::vector<SourceProblem>& Problems() const override { return problems_; }

 private:
  int next_ = 0;
  std::vector<SourceProblem> problems_;
};

struct Seen {
  std::vector<SourceImage> images;
  std::vector<SourceProblem> problems;  // but that of the source itself
};

Seen See(const std::string& faults) {
  const auto source = InjectFaults(std::make_unique<CountingSource>(), ParseFaults(faults, "--inject"));
  Seen seen;
  while (auto image = source->Next()) seen.images.push_back(std::move(*image));
  for (const SourceProblem& problem : source->Problems()) {
    if (problem.name != "4b") seen.problems.push_back(problem);
  }
  EXPECT_EQ(source->Problems().size(), seen.problems.size() + 1);
  EXPECT_EQ(source->Layout(), "counting");
  EXPECT_TRUE(source->IsLive());
  EXPECT_EQ(source->EndReason(), "it was enough");
  EXPECT_EQ(source->ImageSize(), cv::Size(6, 4));
  return seen;
}

bool IsAsItWas(const SourceImage& image) {
  return image.image.at<uint8_t>(0, 0) == CountingSource::GreyOf(std::stoi(image.name));
}

TEST(FaultInjection, WithoutFaultsNothingChanges) {
  const Seen seen = See("");
  ASSERT_EQ(seen.images.size(), size_t{kFrames});
  EXPECT_THAT(seen.problems, IsEmpty());
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_EQ(seen.images[i].name, std::to_string(i));
    EXPECT_EQ(seen.images[i].timestamp_s, 100 + 0.1 * i);
    EXPECT_TRUE(IsAsItWas(seen.images[i]));
  }
}

TEST(FaultInjection, AShareOfTheFramesIsDroppedByTheSeed) {
  const auto names = [](const Seen& seen) {
    std::set<std::string> all;
    for (const SourceProblem& problem : seen.problems) all.insert(problem.name);
    return all;
  };
  const Seen seen = See("drop=0.1");
  EXPECT_NEAR(static_cast<double>(seen.problems.size()), 0.1 * kFrames, 30);  // three standard deviations
  EXPECT_EQ(seen.images.size() + seen.problems.size(), size_t{kFrames});
  EXPECT_THAT(seen.problems[0].reason, HasSubstr("dropped"));
  EXPECT_EQ(names(seen), names(See("drop=0.1")));
  EXPECT_NE(names(seen), names(See("drop=0.1,seed=2")));
  EXPECT_EQ(names(seen), names(See("drop=0.1,black=0.5")));
}

TEST(FaultInjection, FaultsStayInTheirTime) {
  const Seen seen = See("drop=1,from=20,to=30");
  ASSERT_EQ(seen.problems.size(), 100u);
  EXPECT_EQ(seen.problems.front().name, "200");
  EXPECT_EQ(seen.problems.back().name, "299");
}

TEST(FaultInjection, TheFirstFrameIsAlwaysGood) {
  const Seen seen = See("black=1");
  EXPECT_TRUE(IsAsItWas(seen.images[0]));
  for (size_t i = 1; i < seen.images.size(); ++i) EXPECT_EQ(cv::countNonZero(seen.images[i].image), 0);
}

TEST(FaultInjection, ImagesAreBlurredExposedAndFrozen) {
  const Seen blurred = See("blur=1"), exposed = See("exposure=1"), frozen = See("freeze=1,from=1,to=2");
  int across = 0, darker = 0, brighter = 0;
  for (int i = 1; i < kFrames; ++i) {
    const int grey = CountingSource::GreyOf(i);
    // Nothing gets brighter than it was, or darker; blur along the edge leaves it.
    EXPECT_LE(blurred.images[i].image.at<uint8_t>(1, 2), grey + 1);
    EXPECT_GE(blurred.images[i].image.at<uint8_t>(1, 2), grey / 2 - 1);
    across += blurred.images[i].image.at<uint8_t>(1, 2) < grey - grey / 16;
    const int now = exposed.images[i].image.at<uint8_t>(0, 0);
    EXPECT_GE(now, grey / 4);
    darker += now < grey;
    brighter += now > grey;
  }
  EXPECT_GT(across, kFrames / 2);
  EXPECT_GT(darker, kFrames / 3);
  EXPECT_GT(brighter, kFrames / 3);
  for (int i = 10; i < 20; ++i) {
    EXPECT_EQ(frozen.images[i].image.at<uint8_t>(0, 0), CountingSource::GreyOf(9));
    EXPECT_EQ(frozen.images[i].timestamp_s, 100 + 0.1 * i);
  }
  EXPECT_TRUE(IsAsItWas(frozen.images[20]));
}

TEST(FaultInjection, WrongSizesAndStampsAreRefusedAsThoseOfFilesAre) {
  const Seen resized = See("resize=1");
  EXPECT_EQ(resized.images.size(), 1u);
  EXPECT_THAT(resized.problems[0].reason, HasSubstr("its size is 3 x 2 px"));

  const Seen stamped = See("stamp=0.2");
  std::set<std::string> reasons;
  for (const SourceProblem& problem : stamped.problems) {
    for (const char* reason : {"nan", "goes back", "is a duplicate"}) {
      if (problem.reason.find(reason) != std::string::npos) reasons.insert(reason);
    }
  }
  EXPECT_THAT(reasons, ElementsAre("goes back", "is a duplicate", "nan"));
  for (size_t i = 1; i < stamped.images.size(); ++i) {
    EXPECT_THAT(stamped.images[i - 1].timestamp_s, Lt(stamped.images[i].timestamp_s));
  }
}

TEST(FaultInjection, OfSwappedFramesTheLateOneIsRefused) {
  const Seen seen = See("swap=1,from=0.95,to=1.05");
  ASSERT_EQ(seen.problems.size(), 1u);
  EXPECT_EQ(seen.problems[0].name, "10");
  EXPECT_THAT(seen.problems[0].reason, HasSubstr("goes back"));
  EXPECT_EQ(seen.images[10].name, "11");
}

TEST(FaultInjection, WhatIsNoFaultIsAnError) {
  const auto complaint = [](const std::string& faults) {
    try {
      ParseFaults(faults, "--inject");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(complaint("dorp=0.1"), HasSubstr("--inject"));
  EXPECT_THAT(complaint("dorp=0.1"), HasSubstr("drop"));
  EXPECT_THAT(complaint("drop=2"), HasSubstr("drop"));
  EXPECT_THAT(complaint("drop"), HasSubstr("drop"));
}

}  // namespace
}  // namespace dynamic_slam
