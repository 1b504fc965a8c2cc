#include "dynamic_slam/geometry/camera.h"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <ostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {

void PrintTo(const Camera& camera, std::ostream* out) { *out << camera.name; }

namespace {

using ::testing::HasSubstr;

Camera Make(const char* name, int width, int height, double fx, double fy, double cx, double cy,
            double k1 = 0, double k2 = 0, double p1 = 0, double p2 = 0, double k3 = 0) {
  return {name, width, height, 30, fx, fy, cx, cy, LensModel::kRadialTangential, k1, k2, p1, p2, k3};
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

constexpr double kDeg = std::numbers::pi / 180;

Camera MakeFisheye(const char* name, int width, int height, double fx, double fy, double cx, double cy,
                   double k1, double k2, double k3, double k4) {
  return {name, width, height, 30, fx, fy, cx, cy, LensModel::kKannalaBrandt, k1, k2, 0, 0, k3, k4};
}

const std::vector<Camera> kFisheyes = {
    MakeFisheye("moderate", 640, 480, 391.2, 390.7, 322.4, 236.9, -0.011, 0.006, -0.004, 0.0009),
    MakeFisheye("beyond_180_deg", 512, 512, 192.3, 191.8, 254.1, 257.6, 0.0041, 0.0007, -0.0021, 0.0002),
    MakeFisheye("equidistant", 800, 600, 300, 300, 399.5, 299.5, 0, 0, 0, 0),
    // Its polynomial turns back at 52 deg, beyond the corners at 32 deg.
    MakeFisheye("turns_back", 640, 480, 800, 800, 320, 240, -0.4, 0, 0, 0),
};

class Fisheye : public ::testing::TestWithParam<Camera> {
 protected:
  // The raw pixel of a ray at theta_rad from the optical axis, towards phi_rad from the x axis.
  static Eigen::Vector2d RawPixelOf(double theta_rad, double phi_rad) {
    const Camera& camera = GetParam();
    const double tangent = std::tan(theta_rad);
    return camera.Distort(camera.Project({tangent * std::cos(phi_rad), tangent * std::sin(phi_rad), 1.0}));
  }

  static cv::Vec4d Coefficients() {
    const Camera& camera = GetParam();
    return {camera.k1, camera.k2, camera.k3, camera.k4};
  }

  static cv::Matx33d Matrix() {
    const Camera& camera = GetParam();
    return {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  }
};

TEST_P(Fisheye, IsValidAndNeverAPinhole) {
  EXPECT_NO_THROW(GetParam().Validate());
  EXPECT_TRUE(GetParam().HasDistortion());
}

TEST_P(Fisheye, DistortUndoesUndistortWhereItSees) {
  const Camera& camera = GetParam();
  int seen = 0;
  for (int y = 0; y < camera.height; y += 7) {
    for (int x = 0; x < camera.width; x += 7) {
      const Eigen::Vector2d raw(x, y);
      const Eigen::Vector2d ideal = camera.Undistort(raw);
      ASSERT_TRUE(ideal.allFinite()) << raw.transpose();
      EXPECT_EQ(camera.CanSee(raw), camera.CanSeeIdeal(ideal)) << raw.transpose();
      if (!camera.CanSee(raw)) continue;
      ++seen;
      EXPECT_LT((camera.Distort(ideal) - raw).norm(), 1e-9) << raw.transpose();
      EXPECT_LT((camera.Undistort(camera.Distort(ideal)) - ideal).norm(), 1e-8) << raw.transpose();
    }
  }
  EXPECT_GT(seen, 2000);
}

TEST_P(Fisheye, TheCentreStaysAndItsNeighboursHardlyMove) {
  const Camera& camera = GetParam();
  const Eigen::Vector2d centre(camera.cx, camera.cy);
  EXPECT_EQ(camera.Undistort(centre), centre);
  EXPECT_EQ(camera.Distort(centre), centre);
  for (const double offset : {1e-13, 1e-9, 1e-4}) {
    const Eigen::Vector2d px = centre + Eigen::Vector2d(offset, -offset);
    EXPECT_LT((camera.Undistort(px) - px).norm(), 1e-12);
    EXPECT_LT((camera.Distort(px) - px).norm(), 1e-12);
  }
}

TEST_P(Fisheye, DistortsAsOpenCv) {
  const Camera& camera = GetParam();
  Random random(3);
  std::vector<cv::Point2d> rays, raws;
  for (int i = 0; i < 500; ++i) rays.emplace_back(random.Uniform(-1.7, 1.7), random.Uniform(-1.7, 1.7));
  cv::fisheye::distortPoints(rays, raws, Matrix(), Coefficients());
  for (size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector2d raw = camera.Distort(camera.Project({rays[i].x, rays[i].y, 1.0}));
    EXPECT_NEAR(raw.x(), raws[i].x, 1e-9);
    EXPECT_NEAR(raw.y(), raws[i].y, 1e-9);
  }
}

TEST_P(Fisheye, UndistortsAsOpenCv) {
  const Camera& camera = GetParam();
  Random random(4);
  std::vector<cv::Point2d> raws, rays;
  while (raws.size() < 500) {
    const Eigen::Vector2d raw(random.Uniform(0, camera.width - 1), random.Uniform(0, camera.height - 1));
    if (camera.CanSee(raw)) raws.emplace_back(raw.x(), raw.y());
  }
  cv::fisheye::undistortPoints(raws, rays, Matrix(), Coefficients());
  for (size_t i = 0; i < raws.size(); ++i) {
    const Eigen::Vector3d ray = camera.Unproject(camera.Undistort({raws[i].x, raws[i].y}));
    EXPECT_NEAR(ray.x(), rays[i].x, 1e-6) << raws[i];  // OpenCV stops at 1e-8 rad
    EXPECT_NEAR(ray.y(), rays[i].y, 1e-6) << raws[i];
  }
}

TEST_P(Fisheye, APointSeenThroughTheLensIsWhereAPinholeSeesIt) {
  const Camera& camera = GetParam();
  Random random(5);
  int tried = 0;
  while (tried < 500) {
    const Eigen::Vector3d x_in_cam(random.Uniform(-4, 4), random.Uniform(-4, 4), random.Uniform(0.5, 5));
    // The formula itself: raw px of the point, from its angle to the optical axis.
    const double theta = std::atan2(x_in_cam.head<2>().norm(), x_in_cam.z());
    if (theta > (camera.name == "turns_back" ? 40 : 60) * kDeg) continue;
    ++tried;
    const double t2 = theta * theta;
    const double radius = theta * (1 + camera.k1 * t2 + camera.k2 * t2 * t2 + camera.k3 * t2 * t2 * t2 +
                                   camera.k4 * t2 * t2 * t2 * t2);
    const double phi = std::atan2(x_in_cam.y(), x_in_cam.x());
    const Eigen::Vector2d raw(camera.fx * radius * std::cos(phi) + camera.cx,
                              camera.fy * radius * std::sin(phi) + camera.cy);
    EXPECT_LT((camera.Undistort(raw) - camera.Project(x_in_cam)).norm(), 1e-9);
  }
}

TEST_P(Fisheye, SeesUpToSixtyDegrees) {
  const Camera& camera = GetParam();
  if (camera.name == "turns_back") return;  // does not reach them
  for (double phi = 0; phi < 6.28; phi += 0.1) {
    EXPECT_TRUE(camera.CanSee(RawPixelOf(59.99 * kDeg, phi)));
    EXPECT_FALSE(camera.CanSee(RawPixelOf(60.01 * kDeg, phi)));
    EXPECT_TRUE(camera.CanSee(RawPixelOf(5 * kDeg, phi)));
    // Exact beyond it too, as images are drawn there, and finite where no pinhole sees.
    const Eigen::Vector2d raw = RawPixelOf(74 * kDeg, phi);
    EXPECT_LT((camera.Distort(camera.Undistort(raw)) - raw).norm(), 1e-9);
    EXPECT_FALSE(camera.CanSee(raw + 100 * (raw - Eigen::Vector2d(camera.cx, camera.cy))));
    EXPECT_TRUE(camera.Undistort(raw + 100 * (raw - Eigen::Vector2d(camera.cx, camera.cy))).allFinite());
  }
}

TEST_P(Fisheye, IdealBoundsAreThoseOfThePixelsItSees) {
  const Camera& camera = GetParam();
  std::array<double, 4> exact{1e9, 1e9, -1e9, -1e9};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d raw(x, y);
      if (!camera.CanSee(raw)) continue;
      const Eigen::Vector2d ideal = camera.Undistort(raw);
      exact = {std::min(exact[0], ideal.x()), std::min(exact[1], ideal.y()), std::max(exact[2], ideal.x()),
               std::max(exact[3], ideal.y())};
    }
  }
  const std::array<double, 4> bounds = camera.IdealBounds();
  for (int i : {0, 1}) {
    EXPECT_NEAR(bounds[i], exact[i], 5);  // a raw px at 60 deg is 4 ideal px
    EXPECT_LT(bounds[i], exact[i] + 0.5);
    EXPECT_NEAR(bounds[i + 2], exact[i + 2], 5);
    EXPECT_GT(bounds[i + 2], exact[i + 2] - 0.5);
  }
}

INSTANTIATE_TEST_SUITE_P(Cameras, Fisheye, ::testing::ValuesIn(kFisheyes));

TEST(Camera, APinholeSeesEverywhere) {
  for (const Camera& camera : kCameras) {
    EXPECT_TRUE(camera.CanSee({0, 0}));
    EXPECT_TRUE(camera.CanSeeIdeal({-1e4, 1e4}));
  }
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
  EXPECT_THAT(Complaint([](Camera& c) { c.fps = 1e6; }), HasSubstr("fps must be at most 100000"));
  EXPECT_THAT(Complaint([](Camera& c) { c.fy = 7186850; }),
              HasSubstr("fy must lie between 0.001 and 1000000, is 7186850"));
  EXPECT_THAT(Complaint([](Camera& c) { c.width = 200000; }), HasSubstr("at most 100000, are 200000 x 480"));
  EXPECT_THAT(Complaint([](Camera& c) { c.p2 = std::numeric_limits<double>::infinity(); }),
              HasSubstr("distortion coefficients must be finite"));
  EXPECT_THAT(Complaint([](Camera& c) { c.k1 = -3; }), HasSubstr("cannot be inverted over the whole image"));
}

TEST(CameraValidate, KnowsWhichCoefficientsBelongToWhichModel) {
  EXPECT_THAT(Complaint([](Camera& c) { c.k4 = 0.1; }),
              HasSubstr("k4 is no coefficient of the radial-tangential"));
  const auto fisheye = [](Camera& c) {
    c = kFisheyes[0];
    c.p2 = 0.1;
  };
  EXPECT_THAT(Complaint(fisheye), HasSubstr("p1 and p2 are no coefficients of the Kannala-Brandt model"));
}

TEST(CameraValidate, AFisheyeMustBeInvertibleUpToTheCornersOrSixtyDegrees) {
  const auto with = [](double focal_px, double k1, double k4) {
    return [=](Camera& c) { c = MakeFisheye("f", 640, 480, focal_px, focal_px, 320, 240, k1, 0, 0, k4); };
  };
  EXPECT_THAT(Complaint(with(400, -0.4, 0)),
              HasSubstr("inverted over the whole image: it turns back 52 deg"));
  EXPECT_EQ(Complaint(with(800, -0.4, 0)), "");   // does not show that
  EXPECT_EQ(Complaint(with(200, -0.29, 0)), "");  // turns back at 61 deg
  EXPECT_THAT(Complaint(with(200, -0.32, 0)), HasSubstr("turns back 58 deg"));
  EXPECT_THAT(Complaint(with(400, 0, std::numeric_limits<double>::quiet_NaN())),
              HasSubstr("distortion coefficients must be finite"));
}

TEST(CameraValidate, ReportsEveryProblemAtOnce) {
  const std::string complaint = Complaint([](Camera& c) { c.fx = 0, c.cy = -5; });
  EXPECT_THAT(complaint, HasSubstr("fx must be positive"));
  EXPECT_THAT(complaint, HasSubstr("cy must lie in the image"));
  EXPECT_THAT(complaint, HasSubstr("calibrate"));
}

}  // namespace
}  // namespace dynamic_slam
