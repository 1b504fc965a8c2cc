#include "dynamic_slam/io/detector_factory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/io/image_preparer.h"

namespace dynamic_slam {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class DetectorFactoryTest : public FolderTest {};

TEST_F(DetectorFactoryTest, KindsWithoutANetwork) {
  EXPECT_EQ(MakeDetector("none"), nullptr);
  EXPECT_EQ(MakeDetector("hog")->name(), "hog");
}

TEST_F(DetectorFactoryTest, UnknownNamesGetASuggestion) {
  EXPECT_THAT(ErrorOf([] { MakeDetector("yolox_nan"); }),
              AllOf(HasSubstr("detector 'yolox_nan'"), HasSubstr("none, hog, boxes:FILE.csv, "),
                    HasSubstr("Did you mean 'yolox_nano'?")));
  EXPECT_THAT(ErrorOf([&] { MakeDetector((folder_ / "a.yaml").string()); }),
              HasSubstr("there is no such file"));
  EXPECT_THAT(ErrorOf([&] { MakeDetector("boxes:" + (folder_ / "a.csv").string()); }),
              AllOf(HasSubstr("a.csv"), HasSubstr("cannot be read")));
}

TEST_F(DetectorFactoryTest, ReplaysABoxFile) {
  const auto file = Write("boxes.csv",
                          "timestamp,class,score,x,y,w,h\n"
                          "2.0,person,0.7,1,2,30,40\n1.0,person,0.9,10,20,30,40\n1.0,car,0.8,5,6,7,8\n");
  const auto detector = MakeDetector("boxes:" + file.string());
  EXPECT_THAT(detector->class_names(), testing::ElementsAre("car", "person"));
  const cv::Mat image = cv::Mat::zeros(100, 100, CV_8UC3);
  const auto first = detector->Detect(image, FrameId(0), 1.001);
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].class_id, 1);
  EXPECT_EQ(first[0].score, 0.9);
  EXPECT_EQ(first[0].box.x, 10);
  EXPECT_EQ(first[1].class_id, 0);
  EXPECT_EQ(detector->Detect(image, FrameId(1), 2.0).size(), 1u);
  EXPECT_THAT(detector->Detect(image, FrameId(2), 3.0), testing::IsEmpty());
}

TEST_F(DetectorFactoryTest, BoxesAreOfTheImagesBeforeTheyArePrepared) {
  const auto file =
      Write("boxes.csv", "timestamp,x,y,w,h\n1.0,20,10,40,60\n2.0,0,0,200,100\n3.0,0,0,15,90\n");
  const auto detector = MakeDetector("boxes:" + file.string());
  Camera camera;
  camera.width = 200, camera.height = 100;
  camera.fx = camera.fy = 100;
  camera.cx = 100, camera.cy = 50;
  ImageOptions options;
  options.crop_left = 16;
  options.crop_top = 20;
  options.crop_width = 160;
  options.resize_width = 80;
  ImagePreparer preparer(camera, options);
  detector->SetPreparation(preparer.box_mapping());
  cv::Mat image;
  preparer.PrepareColour(cv::Mat::zeros(100, 200, CV_8UC3), &image);
  const auto cut = detector->Detect(image, FrameId(0), 1.0);
  ASSERT_EQ(cut.size(), 1u);
  EXPECT_EQ(cut[0].box.x, 2);
  EXPECT_EQ(cut[0].box.y, 0);  // above the crop
  EXPECT_EQ(cut[0].box.width, 20);
  EXPECT_EQ(cut[0].box.height, 25);
  const auto all = detector->Detect(image, FrameId(1), 2.0);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].box.width, 80);
  EXPECT_EQ(all[0].box.height, 40);
  EXPECT_THAT(detector->Detect(image, FrameId(2), 3.0), testing::IsEmpty());  // left of it
}

}  // namespace
}  // namespace dynamic_slam
