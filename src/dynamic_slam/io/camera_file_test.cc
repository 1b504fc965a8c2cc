#include "dynamic_slam/io/camera_file.h"

#include <cstdlib>

#include <gmock/gmock.h>

#include "dynamic_slam/io/test_folder.h"

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;

constexpr char kPlain[] = "width: 640\nheight: 480\nfx: 500\nfy: 501\ncx: 320\ncy: 240\n";

class CameraFile : public FolderTest {};

void ExpectSame(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.fps, b.fps);
  EXPECT_EQ(a.Matrix(), b.Matrix());
  EXPECT_EQ(a.k1, b.k1);
  EXPECT_EQ(a.k2, b.k2);
  EXPECT_EQ(a.p1, b.p1);
  EXPECT_EQ(a.p2, b.p2);
  EXPECT_EQ(a.k3, b.k3);
}

TEST_F(CameraFile, ReadsWithoutDistortionAndNamesItAfterTheFile) {
  const Camera camera = ReadCamera(Write("mine.yaml", kPlain));
  EXPECT_EQ(camera.name, "mine");
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.fy, 501);
  EXPECT_EQ(camera.fps, 0);
  EXPECT_FALSE(camera.HasDistortion());
}

TEST_F(CameraFile, WhatIsWrittenReadsBackIdentically) {
  for (const std::string& name : KnownCameras()) {
    const Camera camera = LoadCamera(name);
    WriteCamera(folder_ / "copy.yaml", camera);
    ExpectSame(ReadCamera(folder_ / "copy.yaml"), camera);
  }
}

TEST_F(CameraFile, ReportsAllProblemsWithLines) {
  const auto file = Write("bad.yaml", "width: 640\nheigth: 480\nfx: wide\nfy: 500\ncx: 320\nK1: 0.1\n");
  const std::string error = ErrorOf([&] { ReadCamera(file); });
  EXPECT_THAT(error, HasSubstr(file.string() + ":2: unknown key 'heigth'. Did you mean 'height'?"));
  EXPECT_THAT(error, HasSubstr(file.string() + ":3: fx must be a number, is 'wide'"));
  EXPECT_THAT(error, HasSubstr(file.string() + ":6: unknown key 'K1'. Did you mean 'k1'?"));
  EXPECT_THAT(error, HasSubstr("the key 'height' is missing"));
  EXPECT_THAT(error, HasSubstr("the key 'cy' is missing"));
  EXPECT_THAT(error, Not(HasSubstr("'fy'")));
}

TEST_F(CameraFile, RefusesOtherModelsAndImpossibleCameras) {
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("a.yaml", std::string(kPlain) + "model: fisheye\n")); }),
              HasSubstr("'fisheye' is not known"));
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("b.yaml", std::string(kPlain) + "k1: -40\n")); }),
              HasSubstr("distortion cannot be inverted"));
}

TEST_F(CameraFile, ShipsTheCamerasOfTheDataSets) {
  EXPECT_THAT(KnownCameras(), IsSupersetOf({"tum_fr1", "tum_fr2", "tum_fr3", "kitti_00-02", "kitti_03",
                                            "kitti_04-12", "euroc", "sevenscenes"}));
  const Camera fr1 = LoadCamera("tum_fr1");
  EXPECT_EQ(fr1.name, "tum_fr1");
  EXPECT_EQ(fr1.fx, 517.306408);
  EXPECT_EQ(fr1.k3, 1.163314);
  EXPECT_EQ(fr1.fps, 30);
  EXPECT_EQ(LoadCamera("kitti_03").height, 375);
  EXPECT_EQ(LoadCamera("euroc").p2, 1.76187114e-05);
}

TEST_F(CameraFile, FindsNamesFromAnyFolderAndPrefersTheUsersOwn) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  EXPECT_NO_THROW(LoadCamera("tum_fr3"));
  std::filesystem::current_path(before);

  Write("cameras/tum_fr3.yaml", kPlain);
  ASSERT_EQ(setenv("DYNAMIC_SLAM_CONFIG", folder_.c_str(), 1), 0);
  EXPECT_EQ(LoadCamera("tum_fr3").fx, 500);
  EXPECT_EQ(LoadCamera("tum_fr2").fx, 520.908620);
  unsetenv("DYNAMIC_SLAM_CONFIG");
}

TEST_F(CameraFile, UnknownNamesListTheKnownOnes) {
  const std::string error = ErrorOf([] { LoadCamera("tum_f1"); });
  EXPECT_THAT(error, HasSubstr("camera 'tum_f1': is neither a file nor a known name"));
  EXPECT_THAT(error, HasSubstr("kitti_03, kitti_04-12, sevenscenes, tum_fr1"));
  EXPECT_THAT(error, HasSubstr("Did you mean 'tum_fr1'?"));
  EXPECT_THAT(ErrorOf([] { LoadCamera("/no/such/camera.yaml"); }), HasSubstr("there is no such file"));
}

TEST_F(CameraFile, ChecksTheImageSize) {
  const Camera camera = LoadCamera("tum_fr1");
  EXPECT_NO_THROW(CheckCameraFits(camera, "", {640, 480}));
  EXPECT_THAT(ErrorOf([&] {
                CheckCameraFits(camera, "my.yaml", {1241, 376});
              }),
              HasSubstr("is for images of 640 x 480 px, these have 1241 x 376 px"));
}

TEST_F(CameraFile, ReadsKittiCalibration) {
  const auto file = Write("calib.txt", "P0: 718.856 0 607.1928 0 0 718.9 185.2157 0 0 0 1 0\nP1: 1 2\n");
  const Camera camera = ReadKittiCalibration(file, {1241, 376}, 10);
  EXPECT_EQ(camera.fx, 718.856);
  EXPECT_EQ(camera.fy, 718.9);
  EXPECT_EQ(camera.cx, 607.1928);
  EXPECT_EQ(camera.cy, 185.2157);
  EXPECT_EQ(camera.width, 1241);
  EXPECT_EQ(camera.fps, 10);
  EXPECT_THAT(ErrorOf([&] {
                ReadKittiCalibration(Write("a.txt", "P0: 1 2 3\n"), {9, 9}, 1);
              }),
              HasSubstr("a.txt:1: P0 has 3 numbers, 12 are wanted"));
  EXPECT_THAT(ErrorOf([&] {
                ReadKittiCalibration(Write("b.txt", "P1: 1\n"), {9, 9}, 1);
              }),
              HasSubstr("has no line 'P0:'"));
}

constexpr char kSensor[] =
    "%YAML:1.0\nsensor_type: camera\ncomment: VI-Sensor cam0\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, "
    "0.0]\n"
    "rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458.654, 457.296, 367.215, "
    "248.375]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, "
    "1.76e-05]\n";

TEST_F(CameraFile, ReadsEurocSensor) {
  const Camera camera = ReadEurocSensor(Write("sensor.yaml", kSensor));
  EXPECT_EQ(camera.width, 752);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fps, 20);
  EXPECT_EQ(camera.fy, 457.296);
  EXPECT_EQ(camera.k1, -0.28340811);
  EXPECT_EQ(camera.p2, 1.76e-05);
  EXPECT_EQ(camera.k3, 0);
}

TEST_F(CameraFile, RefusesOtherEurocSensors) {
  std::string equidistant = kSensor;
  equidistant.replace(equidistant.find("radial-tangential"), 17, "equidistant");
  EXPECT_THAT(ErrorOf([&] { ReadEurocSensor(Write("a.yaml", equidistant)); }), HasSubstr("'equidistant'"));
  std::string few = kSensor;
  few.replace(few.find(", 248.375"), 9, "");
  EXPECT_THAT(ErrorOf([&] { ReadEurocSensor(Write("b.yaml", few)); }),
              HasSubstr("b.yaml:11: 'intrinsics' with 4 numbers is wanted"));
}

}  // namespace
}  // namespace dynamic_slam
