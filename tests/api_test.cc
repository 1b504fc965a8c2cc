// The public API (include/dynamic_slam), with a film of the rendered room.

#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/dynamic_slam.h"
#include "dynamic_slam/system/slam_system.h"
#include "small_room.h"

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ApiTest : public FolderTest {
 protected:
  // The options of SmallRoom::CheapOptions, as a file.
  Options CheapOptions() const {
    Options options;
    options.config = Write("cheap.yaml", OptionsToYaml(SmallRoom::CheapOptions())).string();
    return options;
  }

  static std::vector<ImageResult> Feed(System* system) {
    const SmallRoom& room = SmallRoom::Get();
    std::vector<ImageResult> results;
    for (int i = 0; i < SmallRoom::kFrames; ++i) {
      results.push_back(system->Process(room.Stamp(i), room.image(i)));
    }
    return results;
  }
};

TEST_F(ApiTest, GivesWhatTheSystemInsideGives) {
  const SmallRoom& room = SmallRoom::Get();
  System system(SmallRoom::SmallCamera(), CheapOptions());
  const std::vector<ImageResult> results = Feed(&system);
  SlamSystem inside(SmallRoom::SmallCamera(), SmallRoom::CheapOptions());
  for (int i = 0; i < SmallRoom::kFrames; ++i) inside.Process(room.Stamp(i), room.image(i));
  system.Finish();
  inside.Finish();

  const Trajectory poses = system.Poses(), expected = inside.FrameTrajectory();
  ASSERT_FALSE(expected.empty());
  ASSERT_EQ(poses.size(), expected.size());
  for (size_t i = 0; i < poses.size(); ++i) EXPECT_EQ(poses[i].world_from_cam, expected[i].world_from_cam);
  EXPECT_EQ(system.KeyframePoses().size(), inside.KeyframeTrajectory().size());
  EXPECT_EQ(system.PartCount(), 1u);
  EXPECT_THAT(system.Poses(1), IsEmpty());
  EXPECT_EQ(system.ConfigYaml(), OptionsToYaml(SmallRoom::CheapOptions()));

  int posed = 0;
  for (const ImageResult& result : results) {
    EXPECT_EQ(result.world_from_cam.has_value(), result.state == TrackingState::kTracking);
    EXPECT_TRUE(result.world_from_cam.has_value() || !result.reason.empty());
    posed += result.world_from_cam.has_value();
  }
  EXPECT_EQ(static_cast<size_t>(posed), inside.LiveFrameCount());
}

TEST_F(ApiTest, AMapIsSeenSavedReadExportedAndStartedFrom) {
  System system(SmallRoom::SmallCamera(), CheapOptions());
  Feed(&system);
  system.Finish();
  const MapView map = system.Map();
  ASSERT_EQ(map.parts.size(), 1u);
  EXPECT_EQ(map.parts[0].keyframes.size(), system.KeyframePoses().size());
  ASSERT_FALSE(map.parts[0].landmarks.empty());
  for (const MapView::Landmark& landmark : map.parts[0].landmarks) {
    EXPECT_GE(landmark.observations, 2);
    EXPECT_TRUE(landmark.position.allFinite());
  }

  const std::filesystem::path file = folder_ / "room.map";
  system.SaveMap(file);
  const MapView read = ReadMap(file);
  ASSERT_EQ(read.parts.size(), 1u);
  EXPECT_EQ(read.parts[0].keyframes.size(), map.parts[0].keyframes.size());
  // A file leaves out what is more likely to move.
  const size_t landmarks = read.parts[0].landmarks.size();
  EXPECT_LE(landmarks, map.parts[0].landmarks.size());
  EXPECT_GT(landmarks, map.parts[0].landmarks.size() / 2);
  EXPECT_EQ(read.camera.fx, SmallRoom::SmallCamera().fx);

  EXPECT_EQ(ExportMap(file, folder_ / "exported").keyframes.size(), map.parts[0].keyframes.size());
  EXPECT_EQ(ReadTumTrajectory(folder_ / "exported/keyframes.txt").size(), map.parts[0].keyframes.size());
  EXPECT_TRUE(std::filesystem::exists(folder_ / "exported/colmap/images.txt"));
  EXPECT_THAT(ErrorOf([&] { ExportMap(file, folder_ / "exported", 2); }), HasSubstr("has 1 parts"));

  Options again = CheapOptions();
  again.map = file.string();
  again.localise_only = true;
  System localiser(SmallRoom::SmallCamera(), again);
  Feed(&localiser);
  localiser.Finish();
  EXPECT_EQ(localiser.Map().parts.at(0).landmarks.size(), landmarks);
  EXPECT_FALSE(localiser.Poses().empty());
}

TEST_F(ApiTest, ResetBeginsAnew) {
  System system(SmallRoom::SmallCamera(), CheapOptions());
  Feed(&system);
  system.Finish();
  const Trajectory first = system.Poses();
  EXPECT_THAT(ErrorOf([&] { Feed(&system); }), HasSubstr("the map is final"));
  system.Reset();
  EXPECT_EQ(system.PartCount(), 0u);
  Feed(&system);
  system.Finish();
  ASSERT_EQ(system.Poses().size(), first.size());
  EXPECT_EQ(system.Poses().back().world_from_cam, first.back().world_from_cam);
}

TEST_F(ApiTest, NamesWhatCannotBeUsed) {
  const SmallRoom& room = SmallRoom::Get();
  const Camera camera = SmallRoom::SmallCamera();
  const auto error_of = [&](const Options& options) {
    return ErrorOf([&] { System system(camera, options); });
  };
  Options options;
  options.set = {"orb.featurs=100"};
  EXPECT_THAT(error_of(options), HasSubstr("orb.features"));
  options = {};
  options.detector = "buildin";
  EXPECT_THAT(error_of(options), HasSubstr("builtin"));
  options = {};
  options.localise_only = true;
  EXPECT_THAT(error_of(options), HasSubstr("Options::map"));

  System system(camera, CheapOptions());
  system.Process(room.Stamp(0), room.image(0));
  EXPECT_THAT(ErrorOf([&] { system.Process(room.Stamp(0), room.image(1)); }), HasSubstr("is not after"));
  EXPECT_THAT(ErrorOf([&] { system.Process(std::nan(""), room.image(1)); }), HasSubstr("stamp"));
  EXPECT_THAT(ErrorOf([&] { system.Process(1, cv::Mat(10, 20, CV_8UC1)); }), HasSubstr("20 x 10"));
  EXPECT_THAT(ErrorOf([&] { system.Process(1, room.image(1), cv::Mat(10, 20, CV_8UC1)); }),
              HasSubstr("must be 320 x 240"));
}

}  // namespace
}  // namespace dynamic_slam
