#include "dynamic_slam/sim/room.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/sim/hand_held_path.h"
#include "dynamic_slam/sim/sequence_writer.h"

namespace dynamic_slam {
namespace {

double MeanDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

RoomOptions Options(uint64_t seed, int frames) {
  RoomOptions options;
  options.seed = seed;
  options.frames = frames;
  return options;
}

const Room& RoomOne() {
  static const Room room(Options(1, 300));
  return room;
}

TEST(Room, TheSameSeedGivesTheSameBytesInAnyOrder) {
  const Room again(Options(1, 300));
  const cv::Mat later = again.Frame(150);
  const cv::Mat earlier = again.Frame(3);
  EXPECT_EQ(MeanDifference(RoomOne().Frame(3), earlier), 0);
  EXPECT_EQ(MeanDifference(RoomOne().Frame(150), later), 0);
  for (size_t i = 0; i < again.truth().size(); ++i) {
    ASSERT_EQ(again.truth()[i].world_from_cam.translation, RoomOne().truth()[i].world_from_cam.translation);
    ASSERT_EQ(again.truth()[i].world_from_cam.rotation.coeffs(),
              RoomOne().truth()[i].world_from_cam.rotation.coeffs());
  }
}

// The order of draws is part of the scene: where a compiler is free to choose it, walls look different.
TEST(Room, EveryCompilerDrawsTheSameRoom) {
  cv::Mat1f grey, means;
  RoomOne().Frame(0).convertTo(grey, CV_32F);
  cv::resize(grey, means, {4, 3}, 0, 0, cv::INTER_AREA);
  const cv::Mat1f known = (cv::Mat1f(3, 4) << 86, 116, 85, 127, 80, 106, 96, 101, 77, 98, 112, 130);
  EXPECT_LT(cv::norm(means, known, cv::NORM_INF), 2) << means;
}

TEST(Room, ALongerSequenceBeginsAsAShorterOne) {
  const Room shorter(Options(1, 5));
  EXPECT_EQ(MeanDifference(RoomOne().Frame(4), shorter.Frame(4)), 0);
}

TEST(Room, AnotherSeedGivesAnotherRoomAndPath) {
  const Room other(Options(2, 300));
  EXPECT_GT(MeanDifference(RoomOne().Frame(0), other.Frame(0)), 15);
  const Rigid3 view = RoomOne().truth()[0].world_from_cam;
  EXPECT_GT(MeanDifference(RoomOne().Render(view), other.Render(view)), 15);
  EXPECT_GT((other.truth()[0].world_from_cam.translation - view.translation).norm(), 0.01);
}

TEST(Room, EveryPixelSeesSomething) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Room room(Options(seed, 300));
    for (int i = 0; i < 300; i += 75) {
      const cv::Mat image = room.Render(room.truth()[i].world_from_cam);
      EXPECT_GE(cv::countNonZero(image), static_cast<int>(image.total()) - 20)
          << "seed " << seed << " frame " << i;
      cv::Scalar mean, deviation;
      cv::meanStdDev(image, mean, deviation);
      EXPECT_GT(deviation[0], 25);
    }
  }
}

// What lies on a pixel's ray, computed in the plainest way: grey value of the nearest quad's texture, or -1.
double GreyOnRay(const Scene& scene, const Rigid3& world_from_cam, const Eigen::Vector3d& ray_in_cam) {
  double nearest = 1e9, grey = -1;
  const Eigen::Vector3d ray = world_from_cam.rotation * ray_in_cam;
  for (const TexturedQuad& quad : scene.quads) {
    Eigen::Matrix3d M;
    M << quad.edge_x, quad.edge_y, -ray;
    const Eigen::Vector3d std = M.fullPivLu().solve(world_from_cam.translation - quad.corner);
    const bool front = quad.edge_x.cross(quad.edge_y).dot(ray) > 0;
    if (!front || std[0] < 0 || std[0] > 1 || std[1] < 0 || std[1] > 1 || std[2] < 0 || std[2] > nearest)
      continue;
    nearest = std[2];
    grey = quad.brightness * quad.texture->Sample(static_cast<float>(std[0] * quad.texture->width()),
                                                  static_cast<float>(std[1] * quad.texture->height()), 0.5f);
  }
  return grey;
}

TEST(Room, FramesShowWhatLiesOnTheTrueRays) {
  const Room& room = RoomOne();
  const Camera& camera = room.options().camera;
  for (const int index : {0, 137, 299}) {
    const cv::Mat1b image = room.Frame(index);
    std::vector<double> rendered, expected;
    for (int y = 5; y < image.rows; y += 9) {
      for (int x = 5; x < image.cols; x += 9) {
        rendered.push_back(image(y, x));
        expected.push_back(GreyOnRay(room.scene(), room.truth()[index].world_from_cam,
                                     camera.Unproject(Eigen::Vector2d(x, y))));
      }
    }
    const Eigen::Map<Eigen::ArrayXd> a(rendered.data(), static_cast<Eigen::Index>(rendered.size()));
    const Eigen::Map<Eigen::ArrayXd> b(expected.data(), static_cast<Eigen::Index>(expected.size()));
    EXPECT_GT(b.minCoeff(), 0);
    EXPECT_LT((a - b).abs().mean(), 6) << "frame " << index;
    const double correlation = ((a - a.mean()) * (b - b.mean())).mean() /
                               std::sqrt((a - a.mean()).square().mean() * (b - b.mean()).square().mean());
    EXPECT_GT(correlation, 0.97) << "frame " << index;
  }
}

TEST(Room, NoiseIsAsWideAsStated) {
  RoomOptions options = Options(1, 1);
  options.noise_grey = 3;
  const Room room(options);
  cv::Mat difference;
  cv::subtract(room.Frame(0), room.Render(room.truth()[0].world_from_cam), difference, cv::noArray(), CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(difference, mean, deviation);
  EXPECT_NEAR(mean[0], 0, 0.2);
  EXPECT_NEAR(deviation[0], 3, 0.2);
}

TEST(Room, RefusesOptionsOutOfRange) {
  RoomOptions options = Options(1, 0);
  EXPECT_THROW(Room{options}, InputError);
  options.frames = 1;
  options.camera.fps = 0;
  EXPECT_THROW(Room{options}, InputError);
  options.camera.fps = 30;
  options.noise_grey = -1;
  EXPECT_THROW(Room{options}, InputError);
  EXPECT_THROW(RoomOne().Frame(300), InternalError);
}

TEST(HandHeldPath, IsSmoothAndStaysInReach) {
  const Eigen::Vector3d centre(1, 2, 1.5);
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const HandHeldPath path(seed, centre, 0.3 * static_cast<double>(seed));
    constexpr double kStep = 1.0 / 30;
    double length_m = 0;
    for (int i = 1; i < 300; ++i) {
      const Rigid3 before = path.At((i - 1) * kStep), now = path.At(i * kStep),
                   after = path.At((i + 1) * kStep);
      const Eigen::Vector3d step = now.translation - before.translation;
      EXPECT_LT(step.norm(), 0.05);
      EXPECT_LT(RotationAngle(before.rotation, now.rotation), 0.03);
      EXPECT_LT((after.translation - now.translation - step).norm(), 0.004);  // under 3.6 m/s^2
      EXPECT_LT((now.translation - centre).norm(), HandHeldPath::kReach);
      length_m += step.norm();
    }
    EXPECT_GT(length_m, 4) << seed;
    EXPECT_LT(length_m, 8) << seed;
  }
}

TEST(HandHeldPath, LooksAlongItsHeadingWithTheSkyAbove) {
  for (const double heading_rad : {0.0, 1.0, 2.5, -2.0}) {
    const HandHeldPath path(7, Eigen::Vector3d::Zero(), heading_rad);
    for (double t = 0; t < 10; t += 0.5) {
      const Eigen::Matrix3d R = path.At(t).Matrix();
      EXPECT_GT(R.col(2).dot(Eigen::Vector3d(std::cos(heading_rad), std::sin(heading_rad), 0)), 0.7);
      EXPECT_LT(R.col(1).z(), -0.9);  // the camera's y axis points down
    }
  }
}

TEST(RoomSource, DeliversTheFramesInOrder) {
  const Room room(Options(4, 3));
  const std::unique_ptr<FrameSource> source = MakeRoomSource(room);
  EXPECT_EQ(source->FrameCount(), 3u);
  EXPECT_EQ(source->ImageSize(), cv::Size(640, 480));
  EXPECT_EQ(source->OwnCamera()->fx, 535.4);
  for (int i = 0; i < 3; ++i) {
    const std::optional<SourceImage> image = source->Next();
    ASSERT_TRUE(image);
    EXPECT_EQ(image->timestamp_s, i / 30.0);
    EXPECT_EQ(MeanDifference(image->image, room.Frame(i)), 0);
  }
  EXPECT_FALSE(source->Next());
}

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(WriteTumSequence, WritesASequenceThatReadsBack) {
  const std::filesystem::path base = std::filesystem::path(::testing::TempDir()) / "write_tum_sequence";
  std::filesystem::remove_all(base);
  const Room room(Options(5, 3));
  std::vector<int> told;
  WriteTumSequence(room, base / "a", [&told](int frames) { told.push_back(frames); });
  WriteTumSequence(Room(Options(5, 3)), base / "b");
  EXPECT_THAT(told, ::testing::ElementsAre(1, 2, 3));
  for (const char* name :
       {"rgb.txt", "groundtruth.txt", "camera.yaml", "rgb/0.000000.jpg", "rgb/0.066667.jpg"}) {
    EXPECT_FALSE(Bytes(base / "a" / name).empty()) << name;
    EXPECT_EQ(Bytes(base / "a" / name), Bytes(base / "b" / name)) << name;
  }
  const Trajectory truth = ReadTumTrajectory(base / "a" / "groundtruth.txt");
  ASSERT_EQ(truth.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT((truth[i].world_from_cam.translation - room.truth()[i].world_from_cam.translation).norm(),
              1e-8);
    EXPECT_LT(RotationAngle(truth[i].world_from_cam.rotation, room.truth()[i].world_from_cam.rotation), 1e-7);
  }
  EXPECT_EQ(ReadCamera(base / "a" / "camera.yaml").fy, 539.2);
  const cv::Mat image = cv::imread((base / "a" / "rgb/0.066667.jpg").string(), cv::IMREAD_GRAYSCALE);
  EXPECT_LT(MeanDifference(image, room.Frame(2)), 3);
  const std::unique_ptr<FrameSource> source = OpenFrameSource((base / "a").string(), {});
  EXPECT_EQ(source->Layout(), "tum");
  EXPECT_EQ(source->FrameCount(), 3u);
  std::filesystem::remove_all(base);
}

TEST(WriteTumSequence, SaysWhatCannotBeWritten) {
  EXPECT_THROW(WriteTumSequence(Room(Options(5, 1)), "/dev/null/folder"), InputError);
}

}  // namespace
}  // namespace dynamic_slam
