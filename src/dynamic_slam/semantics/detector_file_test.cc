#include "dynamic_slam/semantics/detector_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr char kGood[] =
    "framework: onnx\nmodel:\n  file: a.onnx\nclasses: person, car\ninput:\n  width: 416\n  height: 320\n"
    "output:\n  decoding: yolox\n";

class DetectorFileTest : public FolderTest {
 protected:
  std::string ErrorIn(const std::string& yaml) {
    return ErrorOf([&] { ReadDetectorFile(Write("a.yaml", yaml)); });
  }
};

TEST_F(DetectorFileTest, ReadsKeysAndDefaults) {
  const DetectorFile detector = ReadDetectorFile(Write("mine.yaml", kGood));
  EXPECT_EQ(detector.name, "mine");
  EXPECT_EQ(detector.options.model.file, "a.onnx");
  EXPECT_EQ(detector.options.input.width, 416);
  EXPECT_EQ(detector.options.score_threshold, 0.4);
  EXPECT_EQ(detector.options.nms_threshold, 0.45);
  EXPECT_THAT(detector.class_names, testing::ElementsAre("person", "car"));
}

TEST_F(DetectorFileTest, ClassNamesComeFromAFileBesideIt) {
  Write("mine.txt", "# a comment\nperson\n-\ntraffic light\n");
  std::string yaml = kGood;
  yaml.replace(yaml.find("person, car"), 11, "mine.txt");
  EXPECT_THAT(ReadDetectorFile(Write("a.yaml", yaml)).class_names,
              testing::ElementsAre("person", "-", "traffic light"));
  std::filesystem::remove(folder_ / "mine.txt");
  EXPECT_THAT(ErrorIn(yaml), AllOf(HasSubstr("mine.txt"), HasSubstr("cannot be read")));
}

TEST_F(DetectorFileTest, ProblemsHaveLinesAndSuggestions) {
  const std::string error = ErrorIn(
      "framework: onxx\nmodle: {file: a}\ninput: {width: 4, height: 320, resise: plain}\noutput: {}\n");
  EXPECT_THAT(error,
              AllOf(HasSubstr("a.yaml:1: framework must be caffe, onnx, darknet or tensorflow, is 'onxx'. "
                              "Did you mean 'onnx'?"),
                    HasSubstr("a.yaml:2: unknown key 'modle'. Did you mean 'model'?")));
  EXPECT_THAT(error, AllOf(HasSubstr("a.yaml:3: input.width is 4, outside its range"),
                           HasSubstr("unknown key 'input.resise'. Did you mean 'input.resize'?"),
                           HasSubstr("the key 'output.decoding' is missing"),
                           HasSubstr("the key 'classes' is missing")));
}

TEST_F(DetectorFileTest, KeysThatNeedEachOther) {
  std::string yaml = kGood;
  EXPECT_THAT(ErrorIn(yaml.replace(yaml.find("onnx"), 4, "caffe")),
              HasSubstr("config.file too, its prototxt"));
  yaml = kGood;
  EXPECT_THAT(ErrorIn(yaml.replace(yaml.find("yolox"), 5, "ssd_raw")), HasSubstr("needs anchors.file"));
  yaml = kGood;
  EXPECT_THAT(ErrorIn(yaml.replace(yaml.find("416"), 3, "417")),
              HasSubstr("multiple of 32 px, not 417 x 320 px"));
}

TEST_F(DetectorFileTest, ClassNamesAreGivenOnce) {
  std::string yaml = kGood;
  EXPECT_THAT(ErrorIn(yaml.replace(yaml.find("person, car"), 11, "a, b, a")),
              HasSubstr("'a' is there twice"));
  yaml = kGood;
  EXPECT_THAT(ErrorIn(yaml.replace(yaml.find("person, car"), 11, "a,, b")),
              HasSubstr("name 2 of 3 is empty"));
}

// The files that come with the program.
TEST_F(DetectorFileTest, AllKnownDetectorsCanBeReadAndKnowPeople) {
  const std::vector<std::string> names = ConfigNames("detectors");
  EXPECT_THAT(names, testing::IsSupersetOf({"mobilenet_ssd", "ssd300_voc", "ssd_mobilenet_v1", "yolo_fastest",
                                            "yolov3_nano_voc", "yolox_nano"}));
  for (const std::string& name : names) {
    const DetectorFile detector = ReadDetectorFile(FindConfig("detectors", "detector", name));
    EXPECT_THAT(detector.class_names, testing::Contains("person")) << name;
    EXPECT_THAT(detector.class_names.size(), testing::AnyOf(5, 20, 80, 90)) << name;
    EXPECT_FALSE(detector.options.origin.empty() || detector.options.about.empty()) << name;
  }
}

}  // namespace
}  // namespace dynamic_slam
