#include <functional>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/diagnosis/clip_advice.h"
#include "dynamic_slam/diagnosis/clip_measures.h"
#include "dynamic_slam/sim/room.h"

namespace dynamic_slam {
namespace {

// Images, 15 a second.
class Clip : public FrameSource {
 public:
  Clip(int frames, std::function<cv::Mat(int)> frame) : frames_(frames), frame_(std::move(frame)) {}

  std::optional<SourceImage> Next() override {
    if (next_ == frames_) return std::nullopt;
    const int i = next_++;
    return SourceImage{i / 15.0, frame_(i), std::to_string(i)};
  }
  size_t FrameCount() const override { return static_cast<size_t>(frames_); }
  std::string Layout() const override { return "images"; }
  std::optional<Camera> OwnCamera() const override { return std::nullopt; }
  cv::Size ImageSize() const override { return {DefaultRoomCamera().width, DefaultRoomCamera().height}; }
  const std::vector<SourceProblem>& Problems() const override { return problems_; }

 private:
  int frames_, next_ = 0;
  std::function<cv::Mat(int)> frame_;
  std::vector<SourceProblem> problems_;
};

class ClipDiagnosisTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 40;

  static const Room& TheRoom() {
    static const Room& room = *new Room([] {
      RoomOptions options;
      options.frames = 2 * kFrames;
      return options;
    }());
    return room;
  }

  // Every other image of the room, rendered once in each process.
  static cv::Mat Image(int index) {
    static std::vector<cv::Mat>& images = *new std::vector<cv::Mat>(kFrames);
    cv::Mat& image = images[static_cast<size_t>(index)];
    if (image.empty()) image = TheRoom().Frame(2 * index);
    return image;
  }

  static std::vector<ClipProblem> Diagnose(std::function<cv::Mat(int)> frame,
                                           const std::optional<Camera>& camera = DefaultRoomCamera()) {
    Clip clip(kFrames, std::move(frame));
    const ClipMeasures m = MeasureClip(camera, &clip);
    std::vector<ClipProblem> problems;
    for (const ClipAdvice& advice : AdviseOnClip(m)) problems.push_back(advice.problem);
    return problems;
  }

  static ClipProblem First(const std::vector<ClipProblem>& problems) {
    EXPECT_FALSE(problems.empty());
    return problems.empty() ? ClipProblem() : problems.front();
  }

  // As the room's, with noise of its own.
  static cv::Mat Noisy(const cv::Mat& image, int seed) {
    cv::RNG random(static_cast<uint64_t>(seed + 1));
    cv::Mat noise(image.size(), CV_16SC1), sum;
    random.fill(noise, cv::RNG::NORMAL, 0, 1.5);
    cv::add(image, noise, sum, {}, CV_8U);
    return sum;
  }
};

TEST_F(ClipDiagnosisTest, NothingIsWrongWithAGoodClip) {
  EXPECT_THAT(Diagnose(Image), ::testing::IsEmpty());
  EXPECT_THAT(Diagnose(Image, std::nullopt), ::testing::IsEmpty());
}

TEST_F(ClipDiagnosisTest, BlackImagesAreTooDark) {
  const auto black = [](int i) { return Noisy(cv::Mat::zeros(480, 640, CV_8UC1), i); };
  EXPECT_EQ(First(Diagnose(black)), ClipProblem::kTooDark);
  EXPECT_EQ(First(Diagnose([](int i) { return Noisy(Image(i) * 0.1, i); })), ClipProblem::kTooDark);
}

TEST_F(ClipDiagnosisTest, WhiteImagesAreOverExposed) {
  EXPECT_EQ(First(Diagnose([](int i) { return cv::Mat(Image(i) * 2.5); })), ClipProblem::kOverExposed);
}

TEST_F(ClipDiagnosisTest, BlurIsSeen) {
  const auto out_of_focus = [](int i) {
    cv::Mat image;
    cv::GaussianBlur(Image(i), image, cv::Size(), 4);
    return Noisy(image, i);
  };
  EXPECT_EQ(First(Diagnose(out_of_focus)), ClipProblem::kBlurred);
  const auto shaken = [](int i) {
    cv::Mat image;
    cv::blur(Image(i), image, cv::Size(15, 1));
    return Noisy(image, i);
  };
  EXPECT_EQ(First(Diagnose(shaken)), ClipProblem::kBlurred);
}

TEST_F(ClipDiagnosisTest, ABlankWallHasLittleTexture) {
  const auto wall = [](int i) { return Noisy(cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)), i); };
  EXPECT_EQ(First(Diagnose(wall)), ClipProblem::kLittleTexture);
}

TEST_F(ClipDiagnosisTest, ACameraThatStandsDoesNotMove) {
  EXPECT_EQ(First(Diagnose([](int i) { return Noisy(Image(0), i); })), ClipProblem::kNoMotion);
}

TEST_F(ClipDiagnosisTest, ACameraThatTurnsOnlyTurns) {
  const auto turning = [](int i) {
    const Rigid3 start = TheRoom().truth().front().world_from_cam;
    const double angle = 0.4 * std::sin(2 * std::numbers::pi * i / kFrames);
    return Noisy(TheRoom().Render({start.rotation * ExpSo3({0.2 * angle, angle, 0}), start.translation}), i);
  };
  EXPECT_EQ(First(Diagnose(turning)), ClipProblem::kOnlyRotation);
}

TEST_F(ClipDiagnosisTest, AWrongFocalLengthIsSeen) {
  for (const double factor : {1.0, 0.7, 1.4}) {
    Camera camera = DefaultRoomCamera();
    camera.fx *= factor;
    camera.fy *= factor;
    Clip clip(kFrames, Image), again(kFrames, Image);
    const ClipMeasures measures = MeasureClip(camera, &clip);
    const std::optional<SelfCalibration> found = CalibrateByMap(camera, &again);
    ASSERT_TRUE(found.has_value());
    const std::vector<ClipAdvice> advice = AdviseOnClip(measures, found);
    if (factor == 1) {
      EXPECT_THAT(advice, ::testing::IsEmpty()) << found->focal_gain;
      EXPECT_NEAR(found->focal_factor, 1, 0.02);
    } else {
      ASSERT_FALSE(advice.empty()) << factor << ": gain " << found->focal_gain << " factor "
                                   << found->focal_factor;
      EXPECT_EQ(advice.front().problem, ClipProblem::kCalibration);
      EXPECT_EQ(found->focal_factor > 1, factor < 1);
    }
  }
}

TEST_F(ClipDiagnosisTest, AWrongLensIsSeen) {
  const Camera pinhole = DefaultRoomCamera();
  Camera barrel = pinhole;
  barrel.k1 = 0.08;  // moves the corners by some ten pixels
  for (const Camera& camera : {pinhole, barrel}) {
    Clip clip(kFrames, Image), again(kFrames, Image);
    const ClipMeasures measures = MeasureClip(camera, &clip);
    const std::optional<SelfCalibration> found = CalibrateByMap(camera, &again);
    ASSERT_TRUE(found.has_value());
    const double bound = std::hypot(pinhole.cx / pinhole.fx, pinhole.cy / pinhole.fy);
    const auto stretch = [&](double r2) { return r2 * (found->k1 + r2 * found->k2); };
    EXPECT_LT(std::abs(stretch(0.5 * bound * bound)), 0.01) << found->k1 << " " << found->k2;
    if (camera.k1 == 0) {
      EXPECT_LT(found->lens_gain, 0.02);
      continue;
    }
    EXPECT_GT(found->lens_gain, 0.02);
    const std::vector<ClipAdvice> advice = AdviseOnClip(measures, found);
    ASSERT_FALSE(advice.empty());
    EXPECT_THAT(advice.front().problem,
                testing::AnyOf(ClipProblem::kLens, ClipProblem::kCalibration, ClipProblem::kRollingShutter));
    const std::vector<ClipAdvice> of_lens =
        AdviseOnClip(measures, SelfCalibration{.k1 = 0.0241, .k2 = -0.0097, .lens_gain = 0.02});
    ASSERT_EQ(of_lens.size(), 1u);
    EXPECT_EQ(of_lens.front().problem, ClipProblem::kLens);
    EXPECT_THAT(of_lens.front().text, testing::HasSubstr("k1: 0.0241"));
  }
}

TEST(EdgeWidthTest, GrowsWithTheBlur) {
  cv::Mat1b stripes(240, 320);
  for (int y = 0; y < stripes.rows; ++y) {
    for (int x = 0; x < stripes.cols; ++x) stripes(y, x) = x / 24 % 2 == 0 ? 60 : 180;
  }
  double last = EdgeWidth(stripes);
  EXPECT_GT(last, 1);
  EXPECT_LT(last, 3);
  for (const double sigma : {1.5, 3.0, 4.5}) {
    cv::Mat blurred;
    cv::GaussianBlur(stripes, blurred, cv::Size(), sigma);
    EXPECT_GT(EdgeWidth(blurred), last);
    last = EdgeWidth(blurred);
  }
  EXPECT_EQ(EdgeWidth(cv::Mat1b(240, 320, uchar{100})), 0);
}

}  // namespace
}  // namespace dynamic_slam
