// The detector that comes with the program: its files, and what it finds in rendered scenes that it did not
// learn from.

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/eval/detection_metrics.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/semantics/network_files.h"
#include "dynamic_slam/sim/simulation.h"

namespace dynamic_slam {
namespace {

TEST(BuiltinDetectorTest, ItsFilesAreThereAndSmallAndTheOnesThatWereTrained) {
  const DetectorFile file = ReadDetectorFile(FindConfig("detectors", "detector", "builtin"));
  const std::vector<NetworkFile> files = FindNetworkFiles(file, {});
  ASSERT_EQ(files.size(), 2u);
  uintmax_t bytes = 0;
  for (const NetworkFile& one : files) {
    ASSERT_TRUE(one.found.has_value()) << one.wanted.file;
    EXPECT_EQ(one.wanted.sha256, Sha256(*one.found)) << one.wanted.file;
    bytes += std::filesystem::file_size(*one.found);
  }
  EXPECT_LE(bytes, 2'000'000u);
}

class BuiltinDetectorSceneTest : public testing::Test {
 protected:
  // What it finds of a class in some frames of a scene, against the truth.
  DetectionMetrics Compare(const SceneOptions& options, const std::string& class_name) {
    const Simulation simulation(options);
    DetectionMetrics sum;
    for (int i = 0; i < options.frames; ++i) {
      const SimulatedFrame frame = simulation.Frame(i);
      std::vector<BoxRecord> truth, found;
      for (const TrueBox& box : frame.boxes) {
        truth.push_back({.class_name = simulation.world().objects[static_cast<size_t>(box.actor)].class_name,
                         .visible = box.visible,
                         .box = box.box});
      }
      for (const Detection& d : detector_->Detect(frame.image, FrameId(0), 0)) {
        found.push_back({.class_name = detector_->class_names()[static_cast<size_t>(d.class_id)],
                         .score = d.score,
                         .box = d.box});
      }
      sum += CompareFrame(truth, found, {.class_name = class_name});
    }
    return sum;
  }

  // Few frames, far apart.
  static SceneOptions Scene(const std::string& name, uint64_t seed) {
    SceneOptions options = LoadScene(name);
    options.seed = seed;
    options.frames = 6;
    options.camera.fps = 0.5;
    return options;
  }

  const std::unique_ptr<Detector> detector_ = MakeDetector("builtin");
};

// What it reaches is more (docs/builtin_detector.md); this must not be lost.
TEST_F(BuiltinDetectorSceneTest, FindsThePeopleOfACrowd) {
  SceneOptions options = Scene("crowd", 104);
  options.people = {.count = 14, .near_camera = true, .speed_m_per_s = 0.8};
  options.world.richness = 1;
  options.camera.height_m = 1.2;
  const DetectionMetrics people = Compare(options, "person");
  ASSERT_GE(people.hits + people.misses, 12u);
  EXPECT_GE(people.Recall(), 0.8);
  EXPECT_GE(people.Precision(), 0.7);
  EXPECT_EQ(people.FrameRecall(), 1.0);
  // In a hall full of them many boxes are misjudged.
  EXPECT_GE(Compare(Scene("crowd", 104), "person").Recall(), 0.55);
}

TEST_F(BuiltinDetectorSceneTest, SeesNobodyWhereNobodyIs) {
  SceneOptions options = Scene("office", 105);
  options.people.count = 0;
  EXPECT_EQ(Compare(options, "person").false_alarms, 0u);
  EXPECT_GE(Compare(options, "").Recall(), 0.85);  // chairs, screens, plants
}

}  // namespace
}  // namespace dynamic_slam
