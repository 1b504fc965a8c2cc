#include "dynamic_slam/sim/simulation.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/sim/simulation_writer.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

SceneOptions Scene(const std::string& name, int frames, const std::string& camera = "") {
  SceneOptions options = LoadScene(name);
  options.frames = frames;
  if (!camera.empty()) options.camera.model = camera;
  return options;
}

// A white disc on black that faces the camera of a frame, at a pixel and a depth.
Eigen::Vector3d AddMarker(Simulation& simulation, int frame, const Eigen::Vector2d& raw_px, double depth_m) {
  const Camera& camera = simulation.camera();
  const Rigid3& world_from_cam = simulation.truth()[frame].world_from_cam;
  const Eigen::Vector3d centre = depth_m * camera.Unproject(camera.Undistort(raw_px));
  cv::Mat picture = cv::Mat::zeros(128, 128, CV_8UC3);
  cv::circle(picture, {63 << 4 | 8, 63 << 4 | 8}, 24 << 4, cv::Scalar::all(255), cv::FILLED, cv::LINE_AA, 4);
  Surface surface;
  surface.texture = std::make_shared<ColorTexture>(picture);
  surface.shines = true;
  const double side = 24 * depth_m / camera.fx;  // m: 24 px
  Mesh mesh;
  mesh.AddQuad(mesh.AddSurface(surface), centre - Eigen::Vector3d(side / 2, side / 2, 0), {side, 0, 0},
               {0, side, 0});
  simulation.Add({std::make_shared<Mesh>(mesh), world_from_cam});
  return world_from_cam * centre;
}

class EveryScene : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryScene, ShowsKnownPointsWhereTheyProject) {
  // With a lens that bends, motion blur, noise, changing exposure and darker corners.
  SceneOptions options = Scene(GetParam(), 40, "tum_fr1");
  options.people.count = options.cars.moving = 0;  // nobody walks in front of the markers
  options.effects.exposure_change = 0.05;
  // Nearer than everything else, but not so near that a car's motion blurs them unevenly.
  const double near_m = options.camera.motion == "path" && options.camera.speed_m_per_s > 3 ? 2.0 : 0.3;
  for (const int frame : {0, 39}) {
    Simulation simulation(options);
    std::vector<Eigen::Vector3d> points;
    for (int y = 60; y <= 420; y += 90) {
      for (int x = 60; x <= 580; x += 130) {
        points.push_back(
            AddMarker(simulation, frame, {x + 0.37, y - 0.21}, near_m * (1 + 0.005 * ((x * 7 + y) % 100))));
      }
    }
    cv::Mat grey;
    cv::cvtColor(simulation.Frame(frame).image, grey, cv::COLOR_BGR2GRAY);
    std::vector<double> errors;
    for (const Eigen::Vector3d& x_in_world : points) {
      const Camera& camera = simulation.camera();
      const Eigen::Vector3d x_in_cam = simulation.truth()[frame].world_from_cam.Inverse() * x_in_world;
      const Eigen::Vector2d expected = camera.Distort(camera.Project(x_in_cam));
      Eigen::Vector2d sum(0, 0);
      double weight = 0;
      const int left = static_cast<int>(std::lround(expected.x())),
                top = static_cast<int>(std::lround(expected.y()));
      for (int y = top - 8; y <= top + 8; ++y) {
        for (int x = left - 8; x <= left + 8; ++x) {
          const double light = std::max(0.0, grey.at<uint8_t>(y, x) - 25.0);
          sum += light * Eigen::Vector2d(x, y);
          weight += light;
        }
      }
      ASSERT_GT(weight, 2000);
      errors.push_back((sum / weight - expected).norm());
    }
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    EXPECT_LE(errors[errors.size() / 2], 0.1) << "frame " << frame;
  }
}

TEST_P(EveryScene, BoxesMaskAndDepthAgreeWithTheObjects) {
  const Simulation simulation(Scene(GetParam(), 60));
  const World& world = simulation.world();
  for (const int index : {0, 59}) {
    const SimulatedFrame frame = simulation.Frame(index);
    std::vector<int> pixels(world.objects.size());
    cv::Mat1b in_boxes(frame.objects.size(), uint8_t{0});
    for (int i = 0; i < frame.objects.rows * frame.objects.cols; ++i) {
      const int object = frame.objects(i);
      ASSERT_LT(object, static_cast<int>(world.objects.size()));
      ASSERT_EQ(frame.moving(i), object >= 0 && world.objects[object].moves ? 255 : 0);
      if (object >= 0) {
        ++pixels[object];
        ASSERT_GT(frame.depth_m(i), 0);
      }
    }
    for (size_t object = 0; object < pixels.size(); ++object) {
      const auto box = std::find_if(frame.boxes.begin(), frame.boxes.end(), [object](const TrueBox& b) {
        return b.actor == static_cast<int>(object);
      });
      ASSERT_EQ(box != frame.boxes.end(), pixels[object] >= 16) << object;
      if (box == frame.boxes.end()) continue;
      const cv::Rect rect(static_cast<int>(box->box.x), static_cast<int>(box->box.y),
                          static_cast<int>(box->box.width), static_cast<int>(box->box.height));
      const cv::Mat inside = frame.objects(rect) == static_cast<int>(object);
      EXPECT_EQ(cv::countNonZero(inside), pixels[object]);
      EXPECT_EQ(cv::boundingRect(inside).size(), rect.size());
      EXPECT_GE(box->visible, 0);
      EXPECT_LE(box->visible, 1);
    }
  }
}

TEST_P(EveryScene, TheSameSeedGivesTheSameBytesAndAnotherSeedAnotherScene) {
  SceneOptions options = Scene(GetParam(), 8);
  const Simulation one(options), again(options);
  options.seed = 2;
  const Simulation other(options);
  const cv::Mat image = one.Frame(7).image;
  again.Frame(3);  // any order
  EXPECT_EQ(cv::norm(image, again.Frame(7).image, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(image, other.Frame(7).image, cv::NORM_L1) / static_cast<double>(image.total()), 15);
  EXPECT_EQ(one.truth()[7].world_from_cam, again.truth()[7].world_from_cam);
}

INSTANTIATE_TEST_SUITE_P(Simulation, EveryScene, ::testing::ValuesIn(KnownScenes()),
                         [](const auto& scene) { return scene.param; });

TEST(Simulation, VisibleShareIsOneInTheOpenAndLessAtTheBorderAndBehindOthers) {
  SceneOptions options = Scene("office", 300);
  options.people.count = 1;
  options.camera.motion = "static";
  const Simulation simulation(options);
  std::vector<double> shares;
  for (int i = 0; i < 300; i += 6) {
    for (const TrueBox& box : simulation.Frame(i).boxes) {
      if (simulation.world().objects[box.actor].class_name != "person") continue;
      shares.push_back(box.visible);
      const bool at_border = box.box.x <= 0 || box.box.x + box.box.width >= 640;
      if (at_border) {
        EXPECT_LT(box.visible, 0.97);
      }
    }
  }
  ASSERT_GT(shares.size(), 10u);
  EXPECT_LT(*std::min_element(shares.begin(), shares.end()), 0.5);
}

TEST(Simulation, TheCameraStandsStillDuringItsStopAndMovesSmoothly) {
  SceneOptions options = Scene("crowd", 400);
  options.camera.stop_at_s = 4;
  options.camera.stop_s = 3;
  const Simulation simulation(options);
  const Trajectory& truth = simulation.truth();
  const auto position = [&](int i) { return truth[i].world_from_cam.translation; };
  EXPECT_LT((position(205) - position(142)).norm(), 1e-9);
  EXPECT_GT((position(110) - position(100)).norm(), 0.01);
  EXPECT_GT((position(250) - position(240)).norm(), 0.01);
  for (int i = 1; i + 1 < 400; ++i) {
    EXPECT_LT((position(i + 1) - 2 * position(i) + position(i - 1)).norm(), 0.004) << i;  // under 3.6 m/s^2
  }
}

// What the moving pixels of a frame show: the nearest depth in m, and the mean difference of neighbours.
std::pair<float, double> People(const SceneOptions& options) {
  const SimulatedFrame frame = Simulation(options).Frame(0);
  float nearest_m = std::numeric_limits<float>::max();
  double difference = 0;
  int count = 0;
  for (int y = 0; y < frame.image.rows; ++y) {
    for (int x = 1; x < frame.image.cols; ++x) {
      if (frame.moving(y, x) == 0 || frame.moving(y, x - 1) == 0) continue;
      nearest_m = std::min(nearest_m, frame.depth_m(y, x));
      difference += std::abs(frame.image.at<cv::Vec3b>(y, x)[1] - frame.image.at<cv::Vec3b>(y, x - 1)[1]);
      ++count;
    }
  }
  return {nearest_m, difference / std::max(count, 1)};
}

TEST(Simulation, PeopleBeforeTheCameraKeepTheirDistanceAndWearWhatIsAskedFor) {
  SceneOptions options = Scene("crowd", 1);
  options.people.count = options.people.per_row;  // one row
  options.people.nearest_m = 4;
  options.people.richness = 1;
  const auto [far_m, plain] = People(options);
  EXPECT_GT(far_m, 3);  // half a metre to those who come back, and arms that swing
  EXPECT_LT(far_m, 5);
  options.people.richness = 3;
  EXPECT_GT(People(options).second, 1.3 * plain);
  options.people.nearest_m = 2;
  EXPECT_LT(People(options).first, 3);
}

std::string Bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(WriteSimulation, WritesWhatOthersReadAndNoDroppedFrames) {
  const fs::path base = fs::path(::testing::TempDir()) / "write_simulation";
  fs::remove_all(base);
  SceneOptions options = Scene("crowd", 6);
  options.effects.drop_share = 0.5;
  const Simulation simulation(options);
  WriteSimulation(simulation, base / "a", true);
  WriteSimulation(Simulation(options), base / "b", true);
  int kept = 0;
  for (int i = 0; i < 6; ++i) kept += !simulation.IsDropped(i);
  ASSERT_GT(kept, 0);
  ASSERT_LT(kept, 6);
  for (const auto& item : fs::recursive_directory_iterator(base / "a")) {
    if (!item.is_regular_file()) continue;
    const fs::path name = fs::relative(item.path(), base / "a");
    EXPECT_FALSE(Bytes(item.path()).empty()) << name;
    EXPECT_TRUE(Bytes(item.path()) == Bytes(base / "b" / name)) << name;
  }
  const std::unique_ptr<FrameSource> source = OpenFrameSource((base / "a").string(), {});
  EXPECT_EQ(source->FrameCount(), static_cast<size_t>(kept));
  const std::vector<BoxRecord> boxes = ReadBoxFile(base / "a" / "boxes.csv");
  const auto people =
      std::count_if(boxes.begin(), boxes.end(), [](const BoxRecord& b) { return b.class_name == "person"; });
  EXPECT_GT(people, 3 * kept);
  const SimulatedFrame first = simulation.Frame(0);
  const cv::Mat depth = cv::imread((base / "a/depth/0.000000.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_NEAR(depth.at<uint16_t>(240, 320) / 5000.0, first.depth_m(240, 320), 2e-4);
  const cv::Mat mask = cv::imread((base / "a/masks/0.000000.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(mask, first.moving, cv::NORM_INF), 0);
  // The scene beside the images makes the same images again.
  const Simulation again(LoadScene((base / "a/scene.yaml").string()));
  EXPECT_EQ(cv::norm(again.Frame(0).image, first.image, cv::NORM_INF), 0);
  fs::remove_all(base);
}

TEST(LoadScene, SaysWhatIsWrongAndWhere) {
  const fs::path file = fs::path(::testing::TempDir()) / "wrong_scene.yaml";
  std::ofstream(file) << "world:\n  kind: ofice\npeople:\n  cuont: 3\n";
  try {
    LoadScene(file.string());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("wrong_scene.yaml:2: world.kind must be office"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("wrong_scene.yaml:4: unknown key 'people.cuont'"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("people.count"));
  }
  EXPECT_THROW(LoadScene("no_such_scene"), InputError);
  fs::remove(file);
}

}  // namespace
}  // namespace dynamic_slam
