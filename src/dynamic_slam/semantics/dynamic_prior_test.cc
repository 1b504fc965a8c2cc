#include "dynamic_slam/semantics/dynamic_prior.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/semantics/detector_file.h"

namespace dynamic_slam {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class DynamicPriorTest : public FolderTest {
 protected:
  std::string ErrorIn(const std::string& yaml) {
    return ErrorOf([&] { ReadDynamicPrior(Write("prior.yaml", yaml)); });
  }
};

TEST_F(DynamicPriorTest, ScoresByName) {
  const DynamicPrior prior =
      ReadDynamicPrior(Write("prior.yaml", "other: 2.5\nperson: 10\ntraffic light: 0\n"));
  EXPECT_EQ(prior.Score("person"), 10);
  EXPECT_EQ(prior.Score("traffic light"), 0);
  EXPECT_EQ(prior.Score("robot"), 2.5);
  EXPECT_EQ(prior.Score("Person"), 10) << "as some data sets write it";
  EXPECT_EQ(prior.Score("persons"), 2.5);
  EXPECT_THAT(ClassScores(prior, std::vector<std::string>{"-", "person", "other"}),
              testing::ElementsAre(2.5, 10, 2.5));
}

TEST_F(DynamicPriorTest, ProblemsAreListedWithTheirLines) {
  const std::string error =
      ErrorIn("person: 11\ncar: fast\ndog: .nan\ncat: -1\nbus:\nsofa: [1]\n? [a]\n: 1\nperson: 3\n");
  EXPECT_THAT(error,
              AllOf(HasSubstr("prior.yaml:1: the score of person must be a number from 0 (static) to "
                              "10 (dynamic), is '11'"),
                    HasSubstr("prior.yaml:2: the score of car"), HasSubstr("prior.yaml:3: the score of dog"),
                    HasSubstr("prior.yaml:4: the score of cat")));
  EXPECT_THAT(error, AllOf(HasSubstr("prior.yaml:5: the score of bus must be a number from 0 (static) to 10 "
                                     "(dynamic)\n"),
                           HasSubstr("prior.yaml:6: the score of sofa"),
                           HasSubstr("prior.yaml:7: a class name must be plain text"),
                           HasSubstr("prior.yaml:9: person is given a second time, first in line 1"),
                           HasSubstr("'other' is missing")));
}

TEST_F(DynamicPriorTest, FilesThatAreNoPrior) {
  EXPECT_THAT(ErrorIn("other: 1\ncar: [1\n"), HasSubstr("is not YAML"));
  EXPECT_THAT(ErrorIn("- other\n- car\n"), HasSubstr("prior.yaml:1: 'NAME: SCORE' lines are wanted"));
  EXPECT_THAT(ErrorIn("other\n"), HasSubstr("'NAME: SCORE' lines are wanted"));
  EXPECT_THAT(ErrorIn(""), HasSubstr("'other' is missing"));
  EXPECT_THAT(ErrorOf([&] { LoadDynamicPrior((folder_ / "no.yaml").string()); }),
              HasSubstr("there is no such file"));
  EXPECT_THAT(ErrorOf([&] { LoadDynamicPrior("dynamic_prio"); }), HasSubstr("Did you mean 'dynamic_prior'?"));
}

// The file that comes with the program.
TEST_F(DynamicPriorTest, EveryClassOfEveryKnownDetectorHasAScore) {
  const DynamicPrior prior = LoadDynamicPrior("dynamic_prior");
  int names = 0;
  for (const std::string& detector : ConfigNames("detectors")) {
    for (const std::string& name :
         ReadDetectorFile(FindConfig("detectors", "detector", detector)).class_names) {
      if (name == "-") continue;
      EXPECT_TRUE(prior.score_of_class.contains(name)) << name << " of " << detector;
      ++names;
    }
  }
  EXPECT_GE(names, 100);
  EXPECT_EQ(prior.score_of_class.size(), 86u) << "COCO's 80 names and 6 that VOC spells differently";
}

TEST_F(DynamicPriorTest, KnownClassesAreOnTheRightSideOfTheThreshold) {
  const DynamicPrior prior = LoadDynamicPrior("dynamic_prior");
  for (const char* name : {"person", "dog", "cat", "bird", "car", "bus", "bicycle", "sports ball"}) {
    EXPECT_GT(prior.Score(name), 5) << name;
  }
  for (const char* name : {"chair", "book", "laptop", "tv", "couch", "traffic light", "something new"}) {
    EXPECT_LT(prior.Score(name), 5) << name;
  }
  EXPECT_GT(prior.Score("person"), prior.Score("dog"));
  EXPECT_GT(prior.Score("dog"), prior.Score("car"));
}

TEST_F(DynamicPriorTest, TwoNamesOfOneClassHaveOneScore) {
  const DynamicPrior prior = LoadDynamicPrior("dynamic_prior");
  const std::pair<const char*, const char*> names[] = {
      {"aeroplane", "airplane"},       {"motorbike", "motorcycle"}, {"sofa", "couch"},
      {"diningtable", "dining table"}, {"tvmonitor", "tv"},         {"pottedplant", "potted plant"}};
  for (const auto& [voc, coco] : names) EXPECT_EQ(prior.Score(voc), prior.Score(coco)) << voc;
}

}  // namespace
}  // namespace dynamic_slam
