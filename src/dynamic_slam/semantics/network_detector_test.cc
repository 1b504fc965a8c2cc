#include "dynamic_slam/semantics/network_detector.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/semantics/caffe_model_writer.h"
#include "dynamic_slam/semantics/network_files.h"

namespace dynamic_slam {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// A whole SSD with the layers of the paper's: two convolutions over the image, a default box for each of 2 x
// 2 cells, softmax, DetectionOutput.
constexpr char kPrototxt[] = R"(name: "small_ssd"
input: "data"
input_shape { dim: 1 dim: 3 dim: 64 dim: 64 }
layer { name: "loc" type: "Convolution" bottom: "data" top: "loc"
  convolution_param { num_output: 4 kernel_size: 32 stride: 32 } }
layer { name: "loc_perm" type: "Permute" bottom: "loc" top: "loc_perm"
  permute_param { order: 0 order: 2 order: 3 order: 1 } }
layer { name: "loc_flat" type: "Flatten" bottom: "loc_perm" top: "loc_flat" flatten_param { axis: 1 } }
layer { name: "conf" type: "Convolution" bottom: "data" top: "conf"
  convolution_param { num_output: 3 kernel_size: 32 stride: 32 } }
layer { name: "conf_perm" type: "Permute" bottom: "conf" top: "conf_perm"
  permute_param { order: 0 order: 2 order: 3 order: 1 } }
layer { name: "conf_flat" type: "Flatten" bottom: "conf_perm" top: "conf_flat" flatten_param { axis: 1 } }
layer { name: "prior" type: "PriorBox" bottom: "loc" bottom: "data" top: "prior"
  prior_box_param { min_size: 32 clip: false variance: 0.1 variance: 0.1 variance: 0.2 variance: 0.2
    step: 32 offset: 0.5 } }
layer { name: "conf_reshape" type: "Reshape" bottom: "conf_flat" top: "conf_reshape"
  reshape_param { shape { dim: 0 dim: -1 dim: 3 } } }
layer { name: "softmax" type: "Softmax" bottom: "conf_reshape" top: "softmax" softmax_param { axis: 2 } }
layer { name: "softmax_flat" type: "Flatten" bottom: "softmax" top: "softmax_flat" flatten_param { axis: 1 } }
layer { name: "out" type: "DetectionOutput" bottom: "loc_flat" bottom: "softmax_flat" bottom: "prior" top: "out"
  detection_output_param { num_classes: 3 share_location: true background_label_id: 0
    nms_param { nms_threshold: 0.45 top_k: 400 } code_type: CENTER_SIZE keep_top_k: 200
    confidence_threshold: 0.01 } }
)";

// The codes are the same in all cells: a tenth of the default box to the right and up, half as wide. Class 1
// is seen where it is blue, class 2 where it is red: logits (2, 6 blue, 6 red), colours 0 to 1.
std::string SmallSsdWeights() {
  constexpr size_t kPixels = 32 * 32;
  const float half = -5 * std::log(2.0f);
  std::vector<float> conf(9 * kPixels, 0);
  std::fill_n(conf.begin() + 3 * kPixels, kPixels, 6.0f / kPixels);  // label 1, channel 0
  std::fill_n(conf.begin() + 8 * kPixels, kPixels, 6.0f / kPixels);  // label 2, channel 2
  CaffeModelWriter writer;
  writer.AddLayer("loc", "Convolution",
                  {{{4, 3, 32, 32}, std::vector<float>(12 * kPixels, 0)}, {{4}, {1, -1, half, 0}}});
  writer.AddLayer("conf", "Convolution", {{{3, 3, 32, 32}, conf}, {{3}, {2, 0, 0}}});
  return writer.bytes();
}

constexpr char kDetectorFile[] = R"(framework: caffe
model:
  file: ssd.caffemodel
config:
  file: ssd.prototxt
classes: blue thing, red thing
input:
  width: 64
  height: 64
  channels: bgr
  scale: 0.00392156862745098
output:
  decoding: ssd_detection_output
  background_column: 0
)";

class NetworkDetectorTest : public FolderTest {
 protected:
  void SetUp() override {
    Write("ssd.prototxt", kPrototxt);
    Write("ssd.caffemodel", SmallSsdWeights());
  }
  std::unique_ptr<Detector> Make(const std::string& yaml = kDetectorFile) {
    return MakeNetworkDetector(ReadDetectorFile(Write("small.yaml", yaml)), {});
  }
};

TEST_F(NetworkDetectorTest, CaffeSsdGivesTheBoxesWorkedOutByHand) {
  const auto detector = Make();
  EXPECT_EQ(detector->name(), "small");
  EXPECT_THAT(detector->class_names(), testing::ElementsAre("blue thing", "red thing"));
  EXPECT_THAT(detector->warnings(), testing::IsEmpty());
  // Twice as wide as the input: the bottom left cell is blue, the top right one is red.
  cv::Mat image = cv::Mat::zeros(64, 128, CV_8UC3);
  image(cv::Rect(0, 32, 64, 32)).setTo(cv::Scalar(255, 0, 0));
  image(cv::Rect(64, 0, 64, 32)).setTo(cv::Scalar(0, 0, 204));
  const auto found = detector->Detect(image, FrameId(0), 0);
  ASSERT_EQ(found.size(), 2u);
  const double e2 = std::exp(2.0);
  // The default box has its center at (16, 48) and 32 px; the box at (19.2, 44.8), 16 x 32 px; x is doubled.
  EXPECT_EQ(found[0].class_id, 0);
  EXPECT_NEAR(found[0].score, std::exp(6.0) / (e2 + std::exp(6.0) + 1), 1e-3);
  EXPECT_NEAR(found[0].box.x, 22.4, 1e-3);
  EXPECT_NEAR(found[0].box.y, 28.8, 1e-3);
  EXPECT_NEAR(found[0].box.width, 32, 1e-3);
  EXPECT_NEAR(found[0].box.height, 32, 1e-3);
  // Center (51.2, 12.8): y is clipped from -3.2 to 0.
  EXPECT_EQ(found[1].class_id, 1);
  EXPECT_NEAR(found[1].score, std::exp(4.8) / (e2 + 1 + std::exp(4.8)), 1e-3);
  EXPECT_NEAR(found[1].box.x, 86.4, 1e-3);
  EXPECT_NEAR(found[1].box.y, 0, 1e-3);
  EXPECT_NEAR(found[1].box.width, 32, 1e-3);
  EXPECT_NEAR(found[1].box.height, 28.8, 1e-3);
}

TEST_F(NetworkDetectorTest, TheOrderOfColoursCounts) {
  std::string rgb = kDetectorFile;
  rgb.replace(rgb.find("bgr"), 3, "rgb");
  const auto found = Make(rgb)->Detect(cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0)), FrameId(0), 0);
  ASSERT_FALSE(found.empty());
  for (const Detection& d : found) EXPECT_EQ(d.class_id, 1);
}

TEST_F(NetworkDetectorTest, ClassesWithoutANameAreNotReported) {
  std::string yaml = kDetectorFile;
  yaml.replace(yaml.find("blue thing, red thing"), 21, "\"-, red thing\"");
  EXPECT_THAT(Make(yaml)->Detect(cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0)), FrameId(0), 0),
              testing::IsEmpty());
}

TEST_F(NetworkDetectorTest, TheSameImageGivesTheSameBoxes) {
  cv::Mat image(64, 64, CV_8UC3, cv::Scalar(200, 0, 100));
  const auto a = Make()->Detect(image, FrameId(0), 0), b = Make()->Detect(image, FrameId(1), 1);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].score, b[i].score);
}

TEST_F(NetworkDetectorTest, AnotherChecksumIsAWarning) {
  const std::string wrong(64, 'a');
  std::string yaml = kDetectorFile;
  yaml.insert(yaml.find("config:"), "  sha256: " + wrong + "\n");
  const auto detector = Make(yaml);
  EXPECT_THAT(detector->warnings(),
              testing::ElementsAre(AllOf(HasSubstr("ssd.caffemodel"), HasSubstr(wrong),
                                         HasSubstr(Sha256(folder_ / "ssd.caffemodel")))));
}

TEST_F(NetworkDetectorTest, AMissingFileSaysWhereItWasSoughtAndWhereToGetIt) {
  std::filesystem::remove(folder_ / "ssd.caffemodel");
  const std::string yaml = std::string("origin: https://example.org/ssd\n") + kDetectorFile;
  EXPECT_THAT(
      ErrorOf([&] { Make(yaml); }),
      AllOf(HasSubstr("ssd.caffemodel"), HasSubstr("model of detector 'small'"), HasSubstr(folder_.string()),
            HasSubstr("Get it from https://example.org/ssd"), HasSubstr("--models")));
}

TEST_F(NetworkDetectorTest, BrokenFilesAreNamed) {
  Write("ssd.caffemodel", SmallSsdWeights().substr(0, 1000));
  EXPECT_THAT(ErrorOf([&] { Make(); }), HasSubstr("ssd.caffemodel"));
  Write("ssd.caffemodel", SmallSsdWeights());
  Write("ssd.prototxt", "layer { name: nonsense");
  EXPECT_THAT(ErrorOf([&] { Make(); }),
              AllOf(HasSubstr("ssd.prototxt"), HasSubstr("cannot be read as a network of caffe")));
}

TEST_F(NetworkDetectorTest, ADescriptionThatDoesNotFitIsAnErrorBeforeTheFirstImage) {
  std::string yaml = kDetectorFile;
  yaml.replace(yaml.find("ssd_detection_output"), 20, "yolo_region");
  yaml.replace(yaml.find("red thing"), 9, "red thing, green thing");
  EXPECT_THAT(
      ErrorOf([&] { Make(yaml); }),
      AllOf(HasSubstr("small.yaml"), HasSubstr("N x 8 floats is wanted"), HasSubstr("output.decoding")));
}

}  // namespace
}  // namespace dynamic_slam
