#include "dynamic_slam/sim/renderer.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/sim/room.h"

namespace dynamic_slam {
namespace {

Camera WithDistortion() {  // TUM's fr1
  Camera camera = DefaultRoomCamera();
  camera.k1 = 0.262383;
  camera.k2 = -0.953104;
  camera.p1 = -0.005358;
  camera.p2 = 0.002628;
  camera.k3 = 1.163314;
  return camera;
}

Camera Fisheye() {
  Camera camera = DefaultRoomCamera();
  camera.model = LensModel::kKannalaBrandt;
  camera.k1 = -0.011;
  camera.k2 = 0.006;
  camera.k3 = -0.004;
  camera.k4 = 0.0009;
  return camera;
}

constexpr int kSquare = 64, kSquares = 12;  // texels, and how many in a row

TexturedQuad Checkerboard() {
  cv::Mat1b image(kSquare * kSquares, kSquare * kSquares);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image(y, x) = (x / kSquare + y / kSquare) % 2 == 0 ? 40 : 210;
  }
  return {{-0.8, -0.6, 2.0}, {1.6, 0.1, 0.5}, {-0.1, 1.2, 0.4}, std::make_shared<Texture>(image), 1.0};
}

TexturedQuad Plain(uint8_t grey, const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_x,
                   const Eigen::Vector3d& edge_y) {
  return {corner, edge_x, edge_y, std::make_shared<Texture>(cv::Mat(64, 64, CV_8UC1, cv::Scalar(grey))), 1.0};
}

class CornersAreWhereTheyProject : public ::testing::TestWithParam<Camera> {};

TEST_P(CornersAreWhereTheyProject, WithinATenthOfAPixel) {
  const Camera& camera = GetParam();
  const TexturedQuad board = Checkerboard();
  const Renderer renderer(camera);
  for (const Rigid3& world_from_cam : {Rigid3(), Rigid3(ExpSo3({0.05, -0.1, 0.3}), {0.2, 0.1, 0.4}),
                                       Rigid3(ExpSo3({-0.3, 0.1, 0}), {0, -0.8, -0.5})}) {
    cv::Mat image = renderer.Render({{board}}, world_from_cam);
    std::vector<cv::Point2f> expected;
    for (int i = 1; i < kSquares; ++i) {
      for (int j = 1; j < kSquares; ++j) {
        const Eigen::Vector3d x = world_from_cam.Inverse() * board.PointOfTexel(i * kSquare, j * kSquare);
        const Eigen::Vector2d px = camera.Distort(camera.Project(x));
        if ((px - Eigen::Vector2d(320, 240)).cwiseAbs().maxCoeff() < 220)
          expected.emplace_back(px.x(), px.y());
      }
    }
    ASSERT_GT(expected.size(), 30u);
    // The search for corners is exact in smooth images only.
    cv::GaussianBlur(image, image, {}, 1.0);
    std::vector<cv::Point2f> found = expected;
    cv::cornerSubPix(image, found, {5, 5}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4});
    cv::Point2f bias(0, 0);
    for (size_t i = 0; i < found.size(); ++i) {
      // A fisheye bends the lines that the search takes for straight.
      EXPECT_LT(cv::norm(found[i] - expected[i]), camera.model == LensModel::kKannalaBrandt ? 0.15 : 0.1)
          << expected[i];
      bias += (found[i] - expected[i]) / static_cast<float>(found.size());
    }
    EXPECT_LT(cv::norm(bias), 0.01);
  }
}

INSTANTIATE_TEST_SUITE_P(Cameras, CornersAreWhereTheyProject,
                         ::testing::Values(DefaultRoomCamera(), WithDistortion(), Fisheye()));

TEST(Renderer, TheNearerQuadHidesTheFartherWhateverTheirOrder) {
  const TexturedQuad far = Plain(50, {-2, -2, 3}, {4, 0, 0}, {0, 4, 0});
  const TexturedQuad near = Plain(200, {-0.2, -0.2, 2}, {0.4, 0, 0}, {0, 0.4, 0});
  const Renderer renderer(DefaultRoomCamera());
  const cv::Mat one = renderer.Render({{far, near}}, {}), other = renderer.Render({{near, far}}, {});
  EXPECT_EQ(cv::norm(one, other, cv::NORM_INF), 0);
  EXPECT_EQ(one.at<uint8_t>(247, 320), 200);
  EXPECT_EQ(one.at<uint8_t>(100, 100), 50);
}

TEST(Renderer, AQuadHasOneSideAndNothingBehindTheCameraIsSeen) {
  const Renderer renderer(DefaultRoomCamera());
  EXPECT_EQ(cv::countNonZero(renderer.Render({{Plain(99, {2, -2, 3}, {-4, 0, 0}, {0, 4, 0})}}, {})), 0);
  EXPECT_EQ(cv::countNonZero(renderer.Render({{Plain(99, {-2, -2, -3}, {4, 0, 0}, {0, 4, 0})}}, {})), 0);
}

TEST(Renderer, AQuadThatPassesBesideTheCameraIsCutAtIt) {
  // A floor 1 m below that begins behind the camera: seen up to the horizon's height on the wall of its end.
  const TexturedQuad floor = Plain(120, {-5, 1, 8}, {10, 0, 0}, {0, 0, -16});
  const cv::Mat image = Renderer(DefaultRoomCamera()).Render({{floor}}, {});
  const int horizon = static_cast<int>(247.6 + 539.2 / 8);
  EXPECT_EQ(image.at<uint8_t>(479, 320), 120);
  EXPECT_EQ(image.at<uint8_t>(horizon + 3, 320), 120);
  EXPECT_EQ(image.at<uint8_t>(horizon - 3, 320), 0);
}

TEST(Renderer, OutlinesAreCoveredInProportion) {
  Camera camera = DefaultRoomCamera();
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  // Its left edge passes x = 300.25 px, in pixel 300, whose area runs from 299.5 to 300.5: a quarter of it is
  // covered.
  const TexturedQuad quad = Plain(200, {(300.25 - 320) / 500, -1, 1}, {1, 0, 0}, {0, 2, 0});
  const cv::Mat image = Renderer(camera).Render({{quad}}, {});
  EXPECT_EQ(image.at<uint8_t>(240, 299), 0);
  EXPECT_NEAR(image.at<uint8_t>(240, 300), 50, 1);
  EXPECT_EQ(image.at<uint8_t>(240, 301), 200);
}

TEST(Renderer, FineTexturesFarAwayBecomeTheirMean) {
  cv::Mat1b stripes(512, 512);
  for (int x = 0; x < stripes.cols; ++x) stripes.col(x) = x % 2 == 0 ? 0 : 200;
  const TexturedQuad quad{{-5, -5, 10}, {10, 0, 0}, {0, 10, 0}, std::make_shared<Texture>(stripes), 1.0};
  Camera camera = DefaultRoomCamera();
  camera.fx = camera.fy = 100;  // 5 texels in a pixel
  const cv::Mat image = Renderer(camera).Render({{quad}}, {});
  cv::Scalar mean, deviation;
  cv::meanStdDev(image(cv::Rect(290, 220, 60, 50)), mean, deviation);
  EXPECT_NEAR(mean[0], 100, 1);
  EXPECT_LT(deviation[0], 1);
}

TEST(Renderer, RefusesAWrongCamera) {
  Camera camera = DefaultRoomCamera();
  camera.fx = 0;
  EXPECT_THROW(Renderer{camera}, InputError);
}

TEST(Texture, SamplesTexelCentresExactlyAndBetweenThemLinearly) {
  cv::Mat1b image(2, 2);
  image << 10, 20, 30, 60;
  const Texture texture(image);
  EXPECT_FLOAT_EQ(texture.Sample(0.5f, 0.5f, 0), 10);
  EXPECT_FLOAT_EQ(texture.Sample(1.5f, 1.5f, 0), 60);
  EXPECT_FLOAT_EQ(texture.Sample(1.0f, 0.5f, 0), 15);
  EXPECT_FLOAT_EQ(texture.Sample(1.0f, 1.0f, 0), 30);
  EXPECT_FLOAT_EQ(texture.Sample(-9, -9, 0), 10);  // the border goes on
  EXPECT_FLOAT_EQ(texture.Sample(1, 1, 9), 30);    // the coarsest level is the mean
}

}  // namespace
}  // namespace dynamic_slam
