#include "dynamic_slam/io/camera_file.h"

#include <cstdlib>

#include <gmock/gmock.h>

#include "dynamic_slam/base/test_folder.h"

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
  EXPECT_EQ(a.k4, b.k4);
  EXPECT_EQ(a.model, b.model);
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

TEST_F(CameraFile, ACameraLikeAKnownOneButForItsLensGetsThat) {
  const Camera known = LoadCamera("kitti_00-02");
  ASSERT_TRUE(known.HasDistortion());
  Camera camera = known;
  camera.k1 = camera.k2 = 0;
  camera.fps = 7;
  const Camera like = WithKnownLens(camera, "kitti");
  EXPECT_EQ(std::pair(like.k1, like.k2), std::pair(known.k1, known.k2));
  EXPECT_EQ(like.fps, 7);
  EXPECT_FALSE(WithKnownLens(camera, "tum").HasDistortion());
  camera.fx += 1;
  EXPECT_FALSE(WithKnownLens(camera, "kitti").HasDistortion());
  camera.fx = known.fx;
  camera.k1 = 0.5;
  EXPECT_EQ(WithKnownLens(camera, "kitti").k1, 0.5);
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

constexpr char kFisheye[] =
    "model: kannala_brandt\nwidth: 512\nheight: 512\nfx: 192.3\nfy: 191.8\ncx: 254.1\ncy: 257.6\n"
    "k1: 0.0041\nk2: 0.0007\nk3: -0.0021\nk4: 0.0002\n";

TEST_F(CameraFile, ReadsAndWritesFisheyes) {
  const Camera camera = ReadCamera(Write("wide.yaml", kFisheye));
  EXPECT_EQ(camera.model, LensModel::kKannalaBrandt);
  EXPECT_EQ(camera.k1, 0.0041);
  EXPECT_EQ(camera.k3, -0.0021);
  EXPECT_EQ(camera.k4, 0.0002);
  WriteCamera(folder_ / "copy.yaml", camera);
  ExpectSame(ReadCamera(folder_ / "copy.yaml"), camera);
  EXPECT_THAT(ReadFile(folder_ / "copy.yaml"), Not(HasSubstr("p1")));
}

TEST_F(CameraFile, KeysOfTheOtherModelAreNamedWithTheirLines) {
  const std::string fisheye =
      ErrorOf([&] { ReadCamera(Write("a.yaml", std::string(kFisheye) + "p1: 0\np2: 0\n")); });
  EXPECT_THAT(fisheye,
              HasSubstr("a.yaml:12: p1 is no coefficient of model: kannala_brandt, but of model: pinhole"));
  EXPECT_THAT(fisheye, HasSubstr("a.yaml:13: p2 is no"));
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("b.yaml", std::string(kPlain) + "k4: 0.1\n")); }),
              HasSubstr("b.yaml:7: k4 is no coefficient of model: pinhole, but of model: kannala_brandt"));
}

TEST_F(CameraFile, MisspeltKeysAndModelsOfFisheyesAreSuggested) {
  std::string text = kFisheye;
  text.replace(text.find("k4"), 2, "K4");
  const std::string error = ErrorOf([&] { ReadCamera(Write("a.yaml", text)); });
  EXPECT_THAT(error, HasSubstr("a.yaml:11: unknown key 'K4'. Did you mean 'k4'?"));
  EXPECT_THAT(error, HasSubstr("the key 'k4' is missing"));
  text = kFisheye;
  text.replace(text.find("kannala_brandt"), 14, "kanala_brandt");
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("b.yaml", text)); }),
              HasSubstr("b.yaml:1: the model 'kanala_brandt' is not known"));
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("b.yaml", text)); }),
              HasSubstr("Did you mean 'kannala_brandt'?"));
  text = kFisheye;
  text.replace(text.find("model"), 5, "modle");
  EXPECT_THAT(ErrorOf([&] { ReadCamera(Write("c.yaml", text)); }), HasSubstr("Did you mean 'model'?"));
}

TEST_F(CameraFile, FilesOfOtherProgramsAreSentToTheImport) {
  const auto file = Write("a.yaml", "%YAML:1.0\nCamera.fx: 500\n");
  EXPECT_THAT(ErrorOf([&] { ReadCamera(file); }),
              HasSubstr("dynamic_slam config --import-camera " + file.string()));
}

}  // namespace
}  // namespace dynamic_slam
