#include "dynamic_slam/geometry/camera.h"

#include <functional>
#include <limits>
#include <ostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

void PrintTo(const Camera& camera, std::ostream* out) { *out << camera.name; }

namespace {

using ::testing::HasSubstr;

Camera Make(const char* name, int width, int height, double fx, double fy, double cx, double cy,
            double k1 = 0, double k2 = 0, double p1 = 0, double p2 = 0, double k3 = 0) {
  return {name, width, height, 30, fx, fy, cx, cy, k1, k2, p1, p2, k3};
}

const std::vector<Camera> kCameras = {
    Make("tum_fr1", 640, 480, 517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358,
         0.002628, 1.163314),
    Make("tum_fr2", 640, 480, 520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257,
         -0.000105, 0.917205),
    Make("tum_fr3", 640, 480, 535.4, 539.2, 320.1, 247.6),
    Make("kitti_00-02", 1241, 376, 718.856, 718.856, 607.1928, 185.2157),
    Make("kitti_03", 1242, 375, 721.5377, 721.5377, 609.5593, 172.854),
    Make("kitti_04-12", 1226, 370, 707.0912, 707.0912, 601.8873, 183.1104),
    Make("euroc", 752, 480, 458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359,
         1.76187114e-05),
    Make("sevenscenes", 640, 480, 585, 585, 320, 240),
};

class KnownCamera : public ::testing::TestWithParam<Camera> {};

TEST_P(KnownCamera, IsValid) { EXPECT_NO_THROW(GetParam().Validate()); }

TEST_P(KnownCamera, DistortUndoesUndistortOverTheWholeImage) {
  const Camera& camera = GetParam();
  for (int y = -1; y <= camera.height; y += 7) {
    for (int x = -1; x <= camera.width; x += 7) {
      const Eigen::Vector2d raw(x, y);
      const Eigen::Vector2d ideal = camera.Undistort(raw);
      EXPECT_LT((camera.Distort(ideal) - raw).norm(), 1e-9) << raw.transpose();
      EXPECT_LT((camera.Undistort(camera.Distort(ideal)) - ideal).norm(), 1e-8) << raw.transpose();
    }
  }
}

TEST_P(KnownCamera, IdealBoundsHoldEveryUndistortedPixel) {
  const Camera& camera = GetParam();
  const auto [min_x, min_y, max_x, max_y] = camera.IdealBounds();
  constexpr double kSlack = 0.1;  // px; the bounds come from samples of the border
  for (int y = 0; y < camera.height; y += 5) {
    for (int x = 0; x < camera.width; x += 5) {
      const Eigen::Vector2d ideal = camera.Undistort(Eigen::Vector2d(x, y));
      EXPECT_GE(ideal.x(), min_x - kSlack);
      EXPECT_GE(ideal.y(), min_y - kSlack);
      EXPECT_LE(ideal.x(), max_x + kSlack);
      EXPECT_LE(ideal.y(), max_y + kSlack);
    }
  }
}

TEST_P(KnownCamera, ProjectUndoesUnproject) {
  const Camera& camera = GetParam();
  const Eigen::Vector2d px(12.25, 200.5);
  EXPECT_LT((camera.Project(3.7 * camera.Unproject(px)) - px).norm(), 1e-11);
  EXPECT_LT(
      (camera.Project(camera.Unproject(px)) - (camera.Matrix() * camera.Unproject(px)).head<2>()).norm(),
      1e-11);
}

INSTANTIATE_TEST_SUITE_P(Cameras, KnownCamera, ::testing::ValuesIn(kCameras));

TEST(Camera, DistortionFollowsBrownsFormula) {
  const Camera& camera = kCameras[0];
  const double x = 0.2, y = -0.15, r2 = x * x + y * y;
  const double radial = 1 + camera.k1 * r2 + camera.k2 * r2 * r2 + camera.k3 * r2 * r2 * r2;
  const double distorted_x = x * radial + 2 * camera.p1 * x * y + camera.p2 * (r2 + 2 * x * x);
  const double distorted_y = y * radial + camera.p1 * (r2 + 2 * y * y) + 2 * camera.p2 * x * y;
  const Eigen::Vector2d raw = camera.Distort(camera.Project({x, y, 1}));
  EXPECT_NEAR(raw.x(), camera.fx * distorted_x + camera.cx, 1e-10);
  EXPECT_NEAR(raw.y(), camera.fy * distorted_y + camera.cy, 1e-10);
}

std::string Complaint(const std::function<void(Camera&)>& spoil) {
  Camera camera = kCameras[0];
  spoil(camera);
  try {
    camera.Validate();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CameraValidate, NamesTheCameraAndWhatIsWrong) {
  EXPECT_THAT(Complaint([](Camera& c) { c.width = 0; }),
              HasSubstr("width and height must be positive, are 0 x 480"));
  EXPECT_THAT(Complaint([](Camera& c) { c.fx = -1; }),
              HasSubstr("camera 'tum_fr1': fx must be positive, is -1"));
  EXPECT_THAT(Complaint([](Camera& c) { c.fy = std::numeric_limits<double>::infinity(); }),
              HasSubstr("fy must be positive, is inf"));
  EXPECT_THAT(Complaint([](Camera& c) { c.cx = 640; }), HasSubstr("cx must lie in the image, is 640"));
  EXPECT_THAT(Complaint([](Camera& c) { c.cy = std::numeric_limits<double>::quiet_NaN(); }),
              HasSubstr("cy must lie in the image, is nan"));
  EXPECT_THAT(Complaint([](Camera& c) { c.fps = -30; }), HasSubstr("fps must not be negative, is -30"));
  EXPECT_THAT(Complaint([](Camera& c) { c.p2 = std::numeric_limits<double>::infinity(); }),
              HasSubstr("distortion coefficients must be finite"));
  EXPECT_THAT(Complaint([](Camera& c) { c.k1 = -3; }), HasSubstr("cannot be inverted over the whole image"));
}

TEST(CameraValidate, ReportsEveryProblemAtOnce) {
  const std::string complaint = Complaint([](Camera& c) { c.fx = 0, c.cy = -5; });
  EXPECT_THAT(complaint, HasSubstr("fx must be positive"));
  EXPECT_THAT(complaint, HasSubstr("cy must lie in the image"));
  EXPECT_THAT(complaint, HasSubstr("calibrate"));
}

}  // namespace
}  // namespace dynamic_slam
