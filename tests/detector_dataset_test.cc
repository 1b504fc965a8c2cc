// The known trained networks on real images: each finds what any eye does.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/image_file.h"

namespace dynamic_slam {
namespace {

class DetectorDatasetTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    models_ = SharedData() / "detectors";
    if (SharedData().empty()) GTEST_SKIP() << "DYNAMIC_SLAM_DATA is not set: no networks";
    if (!std::filesystem::exists(models_)) GTEST_SKIP() << models_ << " does not exist";
    detector_ = MakeDetector(GetParam(), models_);
    EXPECT_THAT(detector_->warnings(), testing::IsEmpty());
  }

  std::vector<Detection> Detect(const std::string& image) {
    std::string reason;
    return detector_->Detect(ReadImage(models_ / image, &reason), FrameId(0), 0);
  }

  // Whether something of that class is found that covers most of the box, and little more.
  bool Finds(const std::string& image, const std::string& class_name, const Box& box) {
    for (const Detection& d : Detect(image)) {
      if (detector_->class_names()[static_cast<size_t>(d.class_id)] == class_name && IoU(d.box, box) > 0.6) {
        return true;
      }
    }
    return false;
  }

  std::filesystem::path models_;
  std::unique_ptr<Detector> detector_;
};

TEST_P(DetectorDatasetTest, FindsThePersonAndTheDog) {
  EXPECT_TRUE(Finds("person.jpg", "person", {188, 98, 88, 284}));
  EXPECT_TRUE(Finds("dog.jpg", "dog", {130, 215, 185, 330}));
}

TEST_P(DetectorDatasetTest, TheSameImageGivesTheSameBoxes) {
  const auto a = Detect("dog.jpg"), b = Detect("dog.jpg");
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].score, b[i].score);
    EXPECT_EQ(a[i].box.x, b[i].box.x);
  }
}

INSTANTIATE_TEST_SUITE_P(Networks, DetectorDatasetTest,
                         testing::Values("yolox_nano", "ssd_mobilenet_v1", "yolo_fastest", "yolov3_nano_voc"),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace dynamic_slam
