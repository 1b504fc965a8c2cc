#include "dynamic_slam/semantics/decoder.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

void ExpectDetection(const Detection& is, const Box& box, int class_id, double score) {
  EXPECT_NEAR(is.box.x, box.x, 1e-4);
  EXPECT_NEAR(is.box.y, box.y, 1e-4);
  EXPECT_NEAR(is.box.width, box.width, 1e-4);
  EXPECT_NEAR(is.box.height, box.height, 1e-4);
  EXPECT_EQ(is.class_id, class_id);
  EXPECT_NEAR(is.score, score, 1e-6);
}

std::string MessageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(DecoderTest, DetectionOutput) {
  // The form in which the layer gives it: 1 x 1 x N x 7.
  const std::vector<int> shape = {1, 1, 5, 7};
  cv::Mat output(shape, CV_32F);
  const float rows[5][7] = {{0, 2, 0.9f, 0.1f, 0.2f, 0.5f, 0.6f},  // label 2 is class 1
                            {0, 1, 0.3f, 0, 0, 1, 1},              // below the threshold
                            {0, 0, 0.9f, 0, 0, 1, 1},              // background
                            {0, 3, 0.9f, 0, 0, 1, 1},              // a label behind the last
                            {0, 1, 0.4f, -0.5f, 0, 0.5f, 1}};
  std::copy(&rows[0][0], &rows[0][0] + 35, output.ptr<float>());
  const DecoderOptions options{cv::Size(300, 200), 2, 0, 0.4f};
  const auto detections = DecodeDetectionOutput(output, options);
  ASSERT_EQ(detections.size(), 2u);
  ExpectDetection(detections[0], {30, 40, 120, 80}, 1, 0.9);
  ExpectDetection(detections[1], {-150, 0, 300, 200}, 0, 0.4);
}

TEST(DecoderTest, DetectionOutputWithoutBackground) {
  const cv::Mat output = (cv::Mat_<float>(1, 7) << 0, 0, 0.9, 0, 0, 1, 1);
  EXPECT_EQ(DecodeDetectionOutput(output, {cv::Size(10, 10), 1, -1, 0.4}).size(), 1u);
}

TEST(DecoderTest, SsdCodes) {
  const std::vector<Anchor> anchors = {{0.5, 0.5, 0.2, 0.4}, {0.25, 0.75, 0.1, 0.1}};
  // ty tx th tw: half an anchor down, a quarter to the left, twice as tall, half as wide.
  const float log2 = std::log(2.0f);
  const cv::Mat boxes = (cv::Mat_<float>(2, 4) << 5, -2.5, 5 * log2, -5 * log2, 0, 0, 0, 0);
  const cv::Mat scores = (cv::Mat_<float>(2, 3) << 0.9, 0.1, 0.7, 0.1, 0.6, 0.5);
  const auto detections = DecodeSsd(boxes, scores, anchors, {0.1, 0.2}, {cv::Size(100, 200), 2, 0, 0.4});
  ASSERT_EQ(detections.size(), 3u);
  // Center (0.4, 0.6), size (0.2, 0.4).
  ExpectDetection(detections[0], {30, 80, 20, 80}, 1, 0.7);
  ExpectDetection(detections[1], {70, 40, 10, 20}, 0, 0.6);
  ExpectDetection(detections[2], {70, 40, 10, 20}, 1, 0.5);
}

TEST(DecoderTest, BackgroundMayBeTheLastColumn) {
  const cv::Mat boxes = cv::Mat::zeros(1, 4, CV_32F);
  const cv::Mat scores = (cv::Mat_<float>(1, 3) << 0.5, 0.6, 0.9);
  const auto detections = DecodeSsd(boxes, scores, {{0.5, 0.5, 1, 1}}, {}, {cv::Size(10, 10), 2, 2, 0.4});
  ASSERT_EQ(detections.size(), 2u);
  ExpectDetection(detections[0], {0, 0, 10, 10}, 0, 0.5);
  ExpectDetection(detections[1], {0, 0, 10, 10}, 1, 0.6);
}

// Codes of a box, as the training makes them, give the box.
TEST(DecoderTest, SsdDecodesWhatWasEncoded) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Anchor anchor{random.Uniform(), random.Uniform(), random.Uniform(0.05, 1), random.Uniform(0.05, 1)};
    const Box box{random.Uniform(0, 200), random.Uniform(0, 200), random.Uniform(5, 100),
                  random.Uniform(5, 100)};
    cv::Mat_<float> code(1, 4);
    code(0, 0) = static_cast<float>((box.CenterY() / 300 - anchor.center_y) / anchor.height / 0.1);
    code(0, 1) = static_cast<float>((box.CenterX() / 300 - anchor.center_x) / anchor.width / 0.1);
    code(0, 2) = static_cast<float>(std::log(box.height / 300 / anchor.height) / 0.2);
    code(0, 3) = static_cast<float>(std::log(box.width / 300 / anchor.width) / 0.2);
    const auto out = DecodeSsd(code, cv::Mat(1, 1, CV_32F, cv::Scalar(1)), {anchor}, {0.1, 0.2},
                               {cv::Size(300, 300), 1, -1, 0.4});
    ASSERT_EQ(out.size(), 1u);
    EXPECT_GT(IoU(out[0].box, box), 0.9999);
  }
}

TEST(DecoderTest, Region) {
  const cv::Mat output = (cv::Mat_<float>(2, 7) << 0.5, 0.25, 0.2, 0.1, 0.9, 0.8, 0.45,  //
                          0.5, 0.5, 0.5, 0.5, 0.9, 0.1, 0.39);
  const auto detections = DecodeRegion(output, {cv::Size(200, 100), 2, -1, 0.4});
  ASSERT_EQ(detections.size(), 2u) << "the scores hold the object's, and are not multiplied with it again";
  ExpectDetection(detections[0], {80, 20, 40, 10}, 0, 0.8);
  ExpectDetection(detections[1], {80, 20, 40, 10}, 1, 0.45);
}

TEST(DecoderTest, Yolox) {
  // 64 x 32 px: grids of 8 x 4, 4 x 2 and 2 x 1 cells.
  const std::vector<int> shape = {1, 32 + 8 + 2, 7};
  cv::Mat output(shape, CV_32F, cv::Scalar(0));
  const auto set = [&output](int row, std::array<float, 7> values) {
    std::copy(values.begin(), values.end(), output.ptr<float>() + 7 * row);
  };
  const float log2 = std::log(2.0f);
  set(8 + 3, {0.5f, 0.25f, log2, 2 * log2, 0.9f, 0.8f, 0.1f});  // stride 8: row 1, column 3
  set(32 + 5, {0, 0, 0, 0, 0.5f, 0.9f, 1});                     // stride 16: row 1, column 1
  set(32 + 8 + 1, {0.5f, 0.5f, 0, -log2, 0.5f, 0.7f, 0.2f});    // 0.35 and 0.1: too low
  const auto detections = DecodeYolox(output, {cv::Size(64, 32), 2, -1, 0.4});
  ASSERT_EQ(detections.size(), 3u);
  ExpectDetection(detections[0], {20, -6, 16, 32}, 0, 0.72);  // center (28, 10)
  ExpectDetection(detections[1], {8, 8, 16, 16}, 0, 0.45);    // center (16, 16)
  ExpectDetection(detections[2], {8, 8, 16, 16}, 1, 0.5);
}

using Decode = std::function<std::vector<Detection>(const cv::Mat&, const cv::Mat&)>;

struct NamedDecoder {
  const char* name;
  int rows, columns;  // of the first output, as it should be
  Decode decode;      // the second output is only looked at by DecodeSsd
};

std::vector<NamedDecoder> AllDecoders() {
  const DecoderOptions plain{cv::Size(64, 32), 2, -1, 0.4}, with_background{cv::Size(64, 32), 2, 0, 0.4};
  const std::vector<Anchor> anchors(42, Anchor{0.5, 0.5, 0.5, 0.5});
  return {{"DetectionOutput", 42, 7,
           [=](const cv::Mat& a, const cv::Mat&) { return DecodeDetectionOutput(a, with_background); }},
          {"Ssd boxes", 42, 4,
           [=](const cv::Mat& a, const cv::Mat& b) { return DecodeSsd(a, b, anchors, {}, with_background); }},
          {"Ssd scores", 42, 3,
           [=](const cv::Mat& a, const cv::Mat&) {
             return DecodeSsd(cv::Mat::zeros(42, 4, CV_32F), a, anchors, {}, with_background);
           }},
          {"Region", 42, 7, [=](const cv::Mat& a, const cv::Mat&) { return DecodeRegion(a, plain); }},
          {"Yolox", 42, 7, [=](const cv::Mat& a, const cv::Mat&) { return DecodeYolox(a, plain); }}};
}

// Any number that a broken network may give.
float WildNumber(Random& random) {
  const float kinds[] = {kNaN, kInf, -kInf, 3e38f, -3e38f, 0, 1, -1, 1e-40f};
  if (random.Index(3) == 0) return kinds[random.Index(9)];
  return static_cast<float>(random.Uniform(-2, 2) * std::pow(10, random.Uniform(-3, 3)));
}

cv::Mat WildOutput(Random& random, int rows, int columns) {
  cv::Mat_<float> output(rows, columns);
  for (float& value : output) value = WildNumber(random);
  return output;
}

TEST(DecoderTest, AnyNumbersGiveFiniteBoxesOfClassesThatExist) {
  for (const NamedDecoder& decoder : AllDecoders()) {
    Random random(7);
    size_t found = 0;
    for (int round = 0; round < 500; ++round) {
      const cv::Mat a = WildOutput(random, decoder.rows, decoder.columns), b = WildOutput(random, 42, 3);
      for (const Detection& d : decoder.decode(a, b)) {
        ++found;
        EXPECT_TRUE(std::isfinite(d.box.x + d.box.y + d.box.width + d.box.height + d.score)) << decoder.name;
        EXPECT_TRUE(d.class_id == 0 || d.class_id == 1) << decoder.name;
        EXPECT_GE(d.score, 0.4) << decoder.name;
      }
    }
    EXPECT_GT(found, 100u) << decoder.name;
  }
}

TEST(DecoderTest, OtherShapesAreRefusedOrEmpty) {
  for (const NamedDecoder& decoder : AllDecoders()) {
    Random random(8);
    for (int round = 0; round < 500; ++round) {
      const int columns = static_cast<int>(random.Index(10));
      std::vector<int> shape(random.Index(3), 1 + static_cast<int>(random.Index(2)));
      shape.push_back(static_cast<int>(random.Index(60)));
      shape.push_back(columns);
      const int types[] = {CV_32F, CV_32F, CV_32F, CV_64F, CV_8U, CV_32S, CV_32FC2};
      const cv::Mat output(shape, types[random.Index(7)], cv::Scalar::all(0.5));
      const bool is_right_width = output.type() == CV_32F && columns == decoder.columns;
      try {
        decoder.decode(output, cv::Mat::zeros(42, 3, CV_32F));
        EXPECT_TRUE(is_right_width || output.total() == 0) << decoder.name;
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("is wanted")) << decoder.name;
      }
    }
  }
}

TEST(DecoderTest, AnEmptyOutputIsNoObject) {
  const std::vector<int> shape = {1, 1, 0, 7};
  EXPECT_THAT(DecodeDetectionOutput(cv::Mat(shape, CV_32F), {cv::Size(10, 10), 2, 0, 0.4}),
              testing::IsEmpty());
  EXPECT_THAT(DecodeRegion(cv::Mat(0, 7, CV_32F), {cv::Size(10, 10), 2, -1, 0.4}), testing::IsEmpty());
}

TEST(DecoderTest, MessagesSayWhatIsWanted) {
  const DecoderOptions options{cv::Size(64, 32), 2, -1, 0.4};
  EXPECT_THAT(MessageOf([&] { DecodeRegion(cv::Mat::zeros(3, 85, CV_32F), options); }),
              testing::AllOf(testing::HasSubstr("3 x 85"), testing::HasSubstr("N x 7 floats is wanted"),
                             testing::HasSubstr("output.decoding")));
  EXPECT_THAT(MessageOf([&] { DecodeYolox(cv::Mat::zeros(41, 7, CV_32F), options); }),
              testing::HasSubstr("is 41 rows, 42 for an input of 64 x 32 px is wanted"));
  EXPECT_THAT(MessageOf([&] {
                DecodeSsd(cv::Mat::zeros(3, 4, CV_32F), cv::Mat::zeros(3, 2, CV_32F), {}, {}, options);
              }),
              testing::HasSubstr("one for each of the 0 anchors"));
}

}  // namespace
}  // namespace dynamic_slam
