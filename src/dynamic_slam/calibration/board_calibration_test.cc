#include "dynamic_slam/calibration/board_calibration.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/calibration/board_coverage.h"
#include "dynamic_slam/calibration/rendered_board.h"

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr Board kBoard{9, 6, 0.025};
constexpr double kRadPerDeg = std::numbers::pi / 180;

// The board's centre at the raw pixel, so far away that the board is `share` of the image wide, turned by
// angles in deg about its axes.
Rigid3 Pose(const Camera& camera, double u, double v, double share, double turn_x, double turn_y,
            double turn_z) {
  const double width_m = (kBoard.columns - 1) * kBoard.square_m;
  const double depth_m = width_m * camera.fx / (share * camera.width);
  const Eigen::Vector3d center_in_cam =
      depth_m * camera.Unproject(camera.Undistort({u * camera.width, v * camera.height}));
  const Eigen::Quaterniond rotation = ExpSo3(kRadPerDeg * Eigen::Vector3d(turn_x, turn_y, 0)) *
                                      ExpSo3(kRadPerDeg * Eigen::Vector3d(0, 0, turn_z));
  const Eigen::Vector3d center_on_board(0.5 * width_m, 0.5 * (kBoard.rows - 1) * kBoard.square_m, 0);
  return {rotation, center_in_cam - rotation * center_on_board};
}

// The board all over the image, upright and tilted.
std::vector<Rigid3> ManyPoses(const Camera& camera) {
  std::vector<Rigid3> poses;
  for (const double v : {0.24, 0.5, 0.76}) {
    for (const double u : {0.22, 0.5, 0.78}) {
      const double turn_y = 35 * (u < 0.4   ? 1
                                  : u > 0.6 ? -1
                                            : 0),
                   turn_x = 30 * (v < 0.4   ? -1
                                  : v > 0.6 ? 1
                                            : 0);
      poses.push_back(Pose(camera, u, v, 0.3, 0, 0, 5));
      poses.push_back(Pose(camera, u, v, 0.28, turn_x, turn_y, -10));
      poses.push_back(Pose(camera, u, v, 0.26, -turn_x, -turn_y, 80));
    }
  }
  poses.push_back(Pose(camera, 0.5, 0.5, 0.6, 25, 0, 0));
  poses.push_back(Pose(camera, 0.5, 0.5, 0.6, 0, 30, 0));
  poses.push_back(Pose(camera, 0.5, 0.5, 0.6, -20, -20, 0));
  return poses;
}

BoardViews Film(const Camera& camera, const std::vector<Rigid3>& poses) {
  const RenderedBoard film(camera, kBoard);
  Random random(7);
  BoardViews views(cv::Size(camera.width, camera.height));
  for (size_t i = 0; i < poses.size(); ++i) {
    std::optional<BoardView> view = FindBoard(film.Render(poses[i], &random), kBoard, std::to_string(i));
    if (view.has_value()) views.Add(std::move(*view));
  }
  return views;
}

class BoardCalibrationTest : public ::testing::TestWithParam<Camera> {};

TEST_P(BoardCalibrationTest, FindsTheCamera) {
  const Camera& truth = GetParam();
  const BoardViews views = Film(truth, ManyPoses(truth));
  const BoardCalibration calibration = CalibrateBoard(views, kBoard, truth.model);
  const Camera& camera = calibration.camera;
  EXPECT_NEAR(camera.fx / truth.fx, 1, 0.002);
  EXPECT_NEAR(camera.fy / truth.fy, 1, 0.002);
  EXPECT_NEAR(camera.cx, truth.cx, 1);
  EXPECT_NEAR(camera.cy, truth.cy, 1);
  EXPECT_LT(calibration.error_px, 0.2);
  EXPECT_THAT(MissingForCalibration(views, calibration), IsEmpty());
  // The rays of pixels all over the image, not the numbers alone.
  for (const double u : {0.1, 0.5, 0.9}) {
    for (const double v : {0.1, 0.5, 0.9}) {
      const Eigen::Vector2d raw(u * truth.width, v * truth.height);
      const Eigen::Vector3d true_ray = truth.Unproject(truth.Undistort(raw));
      const Eigen::Vector2d again = camera.Distort(camera.Project(true_ray));
      EXPECT_LT((again - raw).norm(), 1) << u << " " << v;
    }
  }
}

Camera MakeCamera(const char* name, int width, int height, double fx, double fy, double cx, double cy) {
  Camera camera;
  camera.name = name;
  camera.width = width, camera.height = height;
  camera.fx = fx, camera.fy = fy, camera.cx = cx, camera.cy = cy;
  return camera;
}

Camera Webcam() {
  Camera camera = MakeCamera("webcam", 640, 480, 517.3, 516.5, 318.6, 255.3);
  camera.k1 = 0.26, camera.k2 = -0.95, camera.p1 = -0.0054, camera.p2 = 0.0026, camera.k3 = 1.16;
  return camera;
}

Camera Wide() {
  Camera camera = MakeCamera("wide", 752, 480, 458.7, 457.3, 367.2, 248.4);
  camera.k1 = -0.283, camera.k2 = 0.074, camera.p1 = 0.0002, camera.p2 = 0.00002;
  return camera;
}

Camera Fisheye() {
  Camera camera = MakeCamera("fisheye", 640, 480, 330, 331, 322, 236);
  camera.model = LensModel::kKannalaBrandt;
  camera.k1 = -0.02, camera.k2 = 0.006, camera.k3 = -0.003, camera.k4 = 0.0005;
  return camera;
}

INSTANTIATE_TEST_SUITE_P(Cameras, BoardCalibrationTest,
                         ::testing::Values(MakeCamera("pinhole", 640, 480, 535.4, 539.2, 320.1, 247.6),
                                           Webcam(), Wide(),
                                           MakeCamera("tele", 960, 540, 1400, 1402, 471, 275), Fisheye()),
                         [](const auto& test) { return test.param.name; });

class LittleCoverageTest : public ::testing::Test {
 protected:
  static std::string Missing(const std::vector<Rigid3>& poses) {
    const BoardViews views = Film(Webcam(), poses);
    const BoardCalibration calibration = CalibrateBoard(views, kBoard, LensModel::kRadialTangential);
    return fmt::format("{}", fmt::join(MissingForCalibration(views, calibration), "\n"));
  }
};

TEST_F(LittleCoverageTest, CornersThatWereNotSeenAreNamed) {
  std::vector<Rigid3> poses;
  for (const Rigid3& pose : ManyPoses(Webcam())) {
    const Eigen::Vector3d center = pose * Eigen::Vector3d(0.1, 0.0625, 0);
    if (center.x() < 0.05 && center.y() < 0.05) poses.push_back(pose);  // neither on the right nor below
  }
  const std::string missing = Missing(poses);
  EXPECT_THAT(missing, HasSubstr("80 % are needed"));
  EXPECT_THAT(missing, HasSubstr("the lower right corner"));
  EXPECT_THAT(missing, HasSubstr("the right edge"));
  EXPECT_THAT(missing, ::testing::Not(HasSubstr("the upper left")));
}

TEST_F(LittleCoverageTest, ABoardThatAlwaysFacesTheCameraIsNotEnough) {
  std::vector<Rigid3> poses;
  for (const double v : {0.22, 0.5, 0.78}) {
    for (const double u : {0.2, 0.5, 0.8}) poses.push_back(Pose(Webcam(), u, v, 0.3, 0, 0, 0));
  }
  EXPECT_THAT(Missing(poses), HasSubstr("tilt it"));
}

TEST_F(LittleCoverageTest, TooFewViewsAreCounted) {
  const std::vector<Rigid3> rests(10, Pose(Webcam(), 0.5, 0.5, 0.5, 10, 0, 0));
  const BoardViews views = Film(Webcam(), rests);
  EXPECT_THAT(views.views(), SizeIs(1));
  try {
    CalibrateBoard(views, kBoard, LensModel::kRadialTangential);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("in 1 image that differ, and 8 are needed"));
  }
}

// Views whose tilts hardly tell decentring from a shifted centre: solved for, it moved the centre by three
// pixels.
TEST(DecentringTest, IsLeftOutWhereItIsNotCertain) {
  Camera truth;
  truth.width = 640;
  truth.height = 480;
  truth.fx = truth.fy = 535.4;
  truth.cx = 320;
  truth.cy = 240;
  std::vector<Rigid3> poses;
  for (const double v : {0.24, 0.5, 0.76}) {
    for (const double u : {0.2, 0.5, 0.8}) {
      const double turn_x = v < 0.4 ? -30 : v > 0.6 ? 30 : 0, turn_y = u < 0.4 ? 35 : u > 0.6 ? -35 : 25;
      poses.push_back(Pose(truth, u, v, 0.27, 0, 0, 3));
      poses.push_back(Pose(truth, u, v, 0.27, turn_x, turn_y, -10));
      poses.push_back(Pose(truth, u, v, 0.27, -turn_x, -turn_y, 80));
    }
  }
  const Camera camera = CalibrateBoard(Film(truth, poses), kBoard, truth.model).camera;
  EXPECT_NEAR(camera.fx / truth.fx, 1, 0.002);
  EXPECT_NEAR(camera.cx, truth.cx, 1);
  EXPECT_NEAR(camera.cy, truth.cy, 1);
}

TEST(BoardCoverageTest, AnEmptyPictureIsRed) {
  const BoardCoverage coverage({}, cv::Size(60, 40));
  EXPECT_EQ(coverage.Share(), 0);
  EXPECT_EQ(coverage.Draw({}).at<cv::Vec3b>(5, 5), cv::Vec3b(170, 170, 255));
  EXPECT_THAT(coverage.Missing(), HasSubstr("the upper left corner, the upper edge, the upper right corner"));
}

TEST(BoardTest, IsReadAndWhatIsWrongIsNamed) {
  EXPECT_EQ(ParseBoard("9x6", 0.025).columns, 9);
  EXPECT_EQ(ParseBoard("9x6", 0.025).rows, 6);
  for (const char* text : {"", "9", "9x", "x6", "9x6x", "9,6", "-9x6", "2x6", "9x1000", "nine x six"}) {
    EXPECT_THROW(ParseBoard(text, 0.025), InputError) << text;
  }
  EXPECT_THROW(ParseBoard("9x6", 0), InputError);
  EXPECT_THROW(ParseBoard("9x6", std::nan("")), InputError);
}

TEST(BoardTest, IsNotFoundWhereThereIsNone) {
  cv::Mat1b noise(240, 320);
  Random random(3);
  for (uchar& grey : noise) grey = static_cast<uchar>(random.Index(256));
  EXPECT_FALSE(FindBoard(noise, kBoard, "noise").has_value());
  EXPECT_FALSE(FindBoard(cv::Mat::zeros(240, 320, CV_8UC1), kBoard, "black").has_value());
}

}  // namespace
}  // namespace dynamic_slam
