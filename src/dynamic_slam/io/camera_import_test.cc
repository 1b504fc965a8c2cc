#include "dynamic_slam/io/camera_import.h"

#include <gmock/gmock.h>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/io/camera_file.h"

namespace dynamic_slam {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CameraImport : public FolderTest {
 protected:
  Camera Import(const std::string& text, const std::optional<cv::Size>& image_size = std::nullopt) const {
    return ImportCamera(Write("lab.yaml", text), image_size);
  }
  std::string ErrorOfImport(const std::string& text,
                            const std::optional<cv::Size>& image_size = std::nullopt) const {
    return ErrorOf([&] { Import(text, image_size); });
  }
};

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

constexpr char kOrbSlam2[] =
    "%YAML:1.0\n"
    "\n"
    "# made up\n"
    "Camera.fx: 501.5\n"
    "Camera.fy: 502.25\n"
    "Camera.cx: 321.5\n"
    "Camera.cy: 238.75\n"
    "\n"
    "Camera.k1: 0.21\n"
    "Camera.k2: -0.7\n"
    "Camera.p1: -0.003\n"
    "Camera.p2: 0.002\n"
    "Camera.k3: 0.8\n"
    "\n"
    "Camera.fps: 25.0\n"
    "Camera.RGB: 1\n"
    "ORBextractor.nFeatures: 1200\n"
    "Viewer.KeyFrameSize: 0.05\n";

void ExpectIsTheOrbSlam2Camera(const Camera& camera) {
  EXPECT_EQ(camera.model, LensModel::kRadialTangential);
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fps, 25);
  EXPECT_EQ(camera.fx, 501.5);
  EXPECT_EQ(camera.fy, 502.25);
  EXPECT_EQ(camera.cx, 321.5);
  EXPECT_EQ(camera.cy, 238.75);
  EXPECT_EQ(camera.k1, 0.21);
  EXPECT_EQ(camera.k2, -0.7);
  EXPECT_EQ(camera.p1, -0.003);
  EXPECT_EQ(camera.p2, 0.002);
  EXPECT_EQ(camera.k3, 0.8);
}

TEST_F(CameraImport, ReadsOrbSlam2WithTheSizeFromTheCaller) {
  const Camera camera = Import(kOrbSlam2, cv::Size(640, 480));
  ExpectIsTheOrbSlam2Camera(camera);
  EXPECT_EQ(camera.name, "lab");
  ExpectIsTheOrbSlam2Camera(
      Import("\xEF\xBB\xBF" + Replaced(kOrbSlam2, "\n", "\n---\n"), cv::Size(640, 480)));
}

TEST_F(CameraImport, ReadsOrbSlam2WithTheSizeFromTheFile) {
  const std::string text = std::string(kOrbSlam2) + "Camera.width: 640\nCamera.height: 480\n";
  ExpectIsTheOrbSlam2Camera(Import(text));
  ExpectIsTheOrbSlam2Camera(Import(text, cv::Size(640, 480)));
  EXPECT_THAT(ErrorOfImport(text, cv::Size(320, 240)),
              HasSubstr("lab.yaml:19: is for images of 640 x 480 px, not of 320 x 240 px"));
}

TEST_F(CameraImport, AMissingSizeComesWithTheRemedy) {
  EXPECT_THAT(ErrorOfImport(kOrbSlam2),
              HasSubstr("lab.yaml: the size of the images is missing: add the lines "
                        "'Camera.width: ...' and 'Camera.height: ...', in px"));
  EXPECT_THAT(ErrorOfImport(std::string(kOrbSlam2) + "Camera.width: 640\n"),
              AllOf(HasSubstr("the key 'Camera.height' is missing"), HasSubstr("1 problem\n")));
}

TEST_F(CameraImport, TheImportedCameraIsACameraFile) {
  WriteCamera(folder_ / "mine.yaml", Import(kOrbSlam2, cv::Size(640, 480)));
  ExpectIsTheOrbSlam2Camera(ReadCamera(folder_ / "mine.yaml"));
}

constexpr char kOrbSlam3[] =
    "%YAML:1.0\n"
    "File.version: \"1.0\"\n"
    "Camera.type: \"PinHole\"\n"
    "Camera1.fx: 440.5\n"
    "Camera1.fy: 441.5\n"
    "Camera1.cx: 370.25\n"
    "Camera1.cy: 250.5\n"
    "Camera1.k1: -0.27\n"
    "Camera1.k2: 0.07\n"
    "Camera1.p1: 0.0002\n"
    "Camera1.p2: 0.00002\n"
    "Camera2.fx: 9999\n"
    "Camera.width: 752\n"
    "Camera.height: 480\n"
    "Camera.newWidth: 600\n"
    "Camera.fps: 20\n"
    "IMU.T_b_c1: !!opencv-matrix\n"
    "   rows: 2\n"
    "   cols: 1\n"
    "   dt: f\n"
    "   data: [1.0, 0.0]\n";

TEST_F(CameraImport, ReadsOrbSlam3) {
  const Camera camera = Import(kOrbSlam3);
  EXPECT_EQ(camera.model, LensModel::kRadialTangential);
  EXPECT_EQ(camera.width, 752);
  EXPECT_EQ(camera.fps, 20);
  EXPECT_EQ(camera.fx, 440.5);
  EXPECT_EQ(camera.k1, -0.27);
  EXPECT_EQ(camera.p2, 0.00002);
  EXPECT_EQ(camera.k3, 0);
}

TEST_F(CameraImport, ReadsRectifiedOrbSlam3WithoutDistortion) {
  EXPECT_FALSE(Import(Replaced(kOrbSlam3, "PinHole", "Rectified")).HasDistortion());
}

TEST_F(CameraImport, ReadsOrbSlam3Fisheyes) {
  for (const std::string prefix : {"Camera", "Camera1"}) {
    const Camera camera = Import(
        "%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\nCamera.width: 512\nCamera.height: 510\n" + prefix +
        ".fx: 190.5\n" + prefix + ".fy: 190.25\n" + prefix + ".cx: 254\n" + prefix + ".cy: 256\n" + prefix +
        ".k1: 0.004\n" + prefix + ".k2: 0.0007\n" + prefix + ".k3: -0.002\n" + prefix + ".k4: 0.0002\n");
    EXPECT_EQ(camera.model, LensModel::kKannalaBrandt);
    EXPECT_EQ(camera.height, 510);
    EXPECT_EQ(camera.cx, 254);
    EXPECT_EQ(camera.k1, 0.004);
    EXPECT_EQ(camera.k2, 0.0007);
    EXPECT_EQ(camera.k3, -0.002);
    EXPECT_EQ(camera.k4, 0.0002);
  }
}

constexpr char kNested[] =
    "Camera:\n"
    "  name: \"hall\"\n"
    "  setup: \"monocular\"\n"
    "  model: \"perspective\"\n"
    "  fx: 900.5\n"
    "  fy: 901.5\n"
    "  cx: 640.5\n"
    "  cy: 360.5\n"
    "  k1: -0.01\n"
    "  k2: 0.02\n"
    "  p1: 0.001\n"
    "  p2: 0.002\n"
    "  k3: 0\n"
    "  fps: 30.0\n"
    "  cols: 1280\n"
    "  rows: 720\n"
    "  color_order: \"RGB\"\n"
    "Feature:\n"
    "  scale_factor: 1.2\n";

TEST_F(CameraImport, ReadsStellaNestedAndFlat) {
  std::string flat = kNested;
  flat = flat.substr(0, flat.find("Feature:"));
  flat = Replaced(flat, "Camera:\n", "");
  for (size_t at = flat.find("  "); at != std::string::npos; at = flat.find("  "))
    flat.replace(at, 2, "Camera.");
  for (const std::string& text : {std::string(kNested), flat}) {
    const Camera camera = Import(text);
    EXPECT_EQ(camera.name, "hall");
    EXPECT_EQ(camera.model, LensModel::kRadialTangential);
    EXPECT_EQ(camera.width, 1280);
    EXPECT_EQ(camera.height, 720);
    EXPECT_EQ(camera.fps, 30);
    EXPECT_EQ(camera.cy, 360.5);
    EXPECT_EQ(camera.p2, 0.002);
  }
}

TEST_F(CameraImport, ReadsStellaFisheyes) {
  std::string text = Replaced(kNested, "perspective", "fisheye");
  text = Replaced(Replaced(text, "p1: 0.001", "k4: 0.001"), "  p2: 0.002\n", "");
  const Camera camera = Import(text);
  EXPECT_EQ(camera.model, LensModel::kKannalaBrandt);
  EXPECT_EQ(camera.k4, 0.001);
}

TEST_F(CameraImport, OtherStellaModelsAreRefusedWithTheReason) {
  EXPECT_THAT(
      ErrorOfImport(Replaced(kNested, "perspective", "equirectangular")),
      AllOf(HasSubstr("lab.yaml:4: equirectangular images are not supported"), HasSubstr("whole sphere")));
  EXPECT_THAT(ErrorOfImport(Replaced(kNested, "perspective", "radial_division")),
              AllOf(HasSubstr("lab.yaml:4: the camera model 'radial_division' is not supported"),
                    HasSubstr("Kannala-Brandt")));
}

constexpr char kKalibr[] =
    "cam0:\n"
    "  cam_overlaps: [1]\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [0.011, -0.012, 0.013, -0.004]\n"
    "  distortion_model: equidistant\n"
    "  intrinsics: [380.5, 381.5, 319.25, 241.75]\n"
    "  resolution: [640, 480]\n"
    "  rostopic: /cam0/image_raw\n"
    "cam1:\n"
    "  T_cn_cnm1:\n"
    "  - [1.0, 0.0, 0.0, 0.1]\n"
    "  camera_model: omni\n"
    "  intrinsics: [1, 2, 3, 4, 5]\n";

TEST_F(CameraImport, ReadsKalibr) {
  const Camera fisheye = Import(kKalibr);
  EXPECT_EQ(fisheye.model, LensModel::kKannalaBrandt);
  EXPECT_EQ(fisheye.name, "lab");
  EXPECT_EQ(fisheye.width, 640);
  EXPECT_EQ(fisheye.height, 480);
  EXPECT_EQ(fisheye.fps, 0);
  EXPECT_EQ(fisheye.fx, 380.5);
  EXPECT_EQ(fisheye.fy, 381.5);
  EXPECT_EQ(fisheye.cx, 319.25);
  EXPECT_EQ(fisheye.cy, 241.75);
  EXPECT_EQ(fisheye.k1, 0.011);
  EXPECT_EQ(fisheye.k2, -0.012);
  EXPECT_EQ(fisheye.k3, 0.013);
  EXPECT_EQ(fisheye.k4, -0.004);
  const Camera radtan = Import(Replaced(kKalibr, "equidistant", "radtan"));
  EXPECT_EQ(radtan.model, LensModel::kRadialTangential);
  EXPECT_EQ(radtan.k2, -0.012);
  EXPECT_EQ(radtan.p1, 0.013);
  EXPECT_EQ(radtan.p2, -0.004);
  const std::string none =
      Replaced(Replaced(kKalibr, "equidistant", "none"), "[0.011, -0.012, 0.013, -0.004]", "[]");
  EXPECT_FALSE(Import(none).HasDistortion());
}

TEST_F(CameraImport, OtherKalibrModelsAreRefused) {
  for (const char* model : {"omni", "ds", "eucm"}) {
    EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "pinhole", model)),
                HasSubstr(fmt::format("lab.yaml:3: the camera model '{}' is not supported", model)));
  }
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "equidistant", "fov")),
              HasSubstr("lab.yaml:5: the distortion 'fov' is not supported"));
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "  distortion_model: equidistant\n", "")),
              HasSubstr("lab.yaml: the distortion '' is not supported"));
}

constexpr char kEuroc[] =
    "%YAML:1.0\nsensor_type: camera\ncomment: cam0\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0]\n"
    "rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [450.5, 451.5, 367.25, 248.5]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.5e-05]\n";

TEST_F(CameraImport, ReadsEuroc) {
  const Camera camera = Import(kEuroc);
  EXPECT_EQ(camera.width, 752);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fps, 20);
  EXPECT_EQ(camera.fy, 451.5);
  EXPECT_EQ(camera.k1, -0.28);
  EXPECT_EQ(camera.p2, 1.5e-05);
  EXPECT_EQ(camera.k3, 0);
  EXPECT_EQ(Import(Replaced(kEuroc, "radial-tangential", "equidistant")).model, LensModel::kKannalaBrandt);
  EXPECT_THAT(ErrorOfImport(Replaced(kEuroc, ", 248.5", "")),
              HasSubstr("lab.yaml:11: 'intrinsics' with 4 numbers is wanted"));
}

TEST_F(CameraImport, EveryProblemIsNamedWithItsLine) {
  std::string text = Replaced(kOrbSlam2, "501.5", "nan");
  text = Replaced(text, "502.25", "wide");
  text = Replaced(text, "321.5", ".inf");
  text = Replaced(text, "238.75", "[1, 2]");
  text = Replaced(text, "Camera.k1", "Camera.K1");
  text = Replaced(text, "25.0", "");
  text += "Camera.width: 640.5\nCamera.height: 1e300\nCamera.k2: 0\nCamera.k6: 0.5\n";
  EXPECT_THAT(ErrorOfImport(text),
              AllOf(HasSubstr("lab.yaml:4: Camera.fx must be a finite number, is 'nan'"),
                    HasSubstr("lab.yaml:5: Camera.fy must be a finite number, is 'wide'"),
                    HasSubstr("lab.yaml:6: Camera.cx must be a finite number, is '.inf'"),
                    HasSubstr("lab.yaml:7: Camera.cy must be a finite number"),
                    HasSubstr("lab.yaml: the key 'Camera.k1' is missing"),
                    HasSubstr("lab.yaml:15: Camera.fps must be a finite number, is ''")));
  EXPECT_THAT(
      ErrorOfImport(text),
      AllOf(HasSubstr("lab.yaml:19: Camera.width must be a whole number from 1 to 100000 px, is 640.5"),
            HasSubstr("lab.yaml:20: Camera.height must be a whole number from 1 to 100000 px, is 1e+300"),
            HasSubstr("lab.yaml:21: Camera.k2 is given a second time, first in line 10"),
            HasSubstr("lab.yaml:22: Camera.k6 is no coefficient of the radial-tangential model"),
            HasSubstr("camera file by hand")));
}

TEST_F(CameraImport, MissingKeysAreNamed) {
  EXPECT_THAT(ErrorOfImport(Replaced(kOrbSlam3, "Camera1.fx: 440.5\n", "")),
              HasSubstr("the key 'Camera1.fx' is missing"));
  EXPECT_THAT(ErrorOfImport(Replaced(kNested, "  rows: 720\n", "")),
              HasSubstr("the key 'Camera.rows' is missing"));
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "resolution", "size")),
              HasSubstr("'cam0.resolution' with 2 numbers is wanted"));
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "0.013, ", "")),
              HasSubstr("lab.yaml:4: 'cam0.distortion_coeffs' with 4 numbers is wanted"));
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "0.013", ".nan")),
              HasSubstr("'cam0.distortion_coeffs' with 4 numbers"));
  EXPECT_THAT(
      ErrorOfImport(Replaced(kOrbSlam3, "PinHole", "KannalaBrandt8")),
      AllOf(HasSubstr("the key 'Camera1.k3' is missing"), HasSubstr("the key 'Camera1.k4' is missing"),
            HasSubstr("lab.yaml:10: Camera1.p1 is no coefficient of the Kannala-Brandt model")));
}

TEST_F(CameraImport, ImpossibleCamerasAreRefusedWithTheFile) {
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "380.5", "-1")),
              AllOf(HasSubstr("lab.yaml: camera 'lab': fx must be positive, is -1")));
  EXPECT_THAT(ErrorOfImport(Replaced(kKalibr, "[640, 480]", "[0, 480]")),
              HasSubstr("must be positive, are 0 x 480"));
  EXPECT_THAT(ErrorOfImport(Replaced(kOrbSlam3, "-0.27", "-27")), HasSubstr("cannot be inverted"));
}

TEST_F(CameraImport, RectifiedStereoIsNotTheCameraOfItsImages) {
  EXPECT_THAT(ErrorOfImport(std::string(kOrbSlam2) + "LEFT.height: 480\n", cv::Size(640, 480)),
              AllOf(HasSubstr("rectifies from a stereo pair"), HasSubstr("left camera alone")));
}

TEST_F(CameraImport, OtherFilesAreRefused) {
  EXPECT_THAT(ErrorOfImport("fx: 500\n"),
              AllOf(HasSubstr("is no calibration of ORB-SLAM"), HasSubstr("--camera")));
  EXPECT_THAT(ErrorOfImport("a: b\n"), HasSubstr("is no calibration of ORB-SLAM"));
  EXPECT_THAT(ErrorOfImport(""), HasSubstr("'key: value' lines are wanted"));
  EXPECT_THAT(ErrorOfImport("just words"), HasSubstr("'key: value' lines are wanted"));
  EXPECT_THAT(ErrorOfImport("Camera.fx: [1, 2\n"), HasSubstr("is not YAML"));
  EXPECT_THAT(ErrorOfImport("Camera: 3\n"), HasSubstr("is no calibration"));
  EXPECT_THAT(ErrorOfImport("Camera: {}\n"), HasSubstr("is no calibration"));
  EXPECT_THAT(ErrorOf([&] { ImportCamera(folder_ / "none.yaml"); }), HasSubstr("none.yaml"));
  EXPECT_THAT(ErrorOf([&] { ImportCamera(folder_); }), Not(HasSubstr("camera '")));
  EXPECT_NE(ErrorOf([&] { ImportCamera(folder_); }), "");
}

TEST_F(CameraImport, EveryTruncationIsReadOrRefused) {
  for (const std::string_view text : {kOrbSlam3, kNested, kKalibr}) {
    for (size_t length = 0; length < text.size(); ++length) {
      const std::string error = ErrorOfImport(std::string(text.substr(0, length)));
      EXPECT_TRUE(error.empty() || error.find("lab.yaml") != std::string::npos) << error;
    }
  }
}

TEST_F(CameraImport, GarbageIsRefused) {
  uint32_t state = 1;
  for (int trial = 0; trial < 200; ++trial) {
    std::string bytes = trial % 2 == 0 ? "" : "Camera.fx: ";
    for (int i = 0; i < 300; ++i) bytes += static_cast<char>((state = state * 1664525u + 1013904223u) >> 24);
    EXPECT_THAT(ErrorOfImport(bytes), HasSubstr("lab.yaml"));
  }
  EXPECT_THAT(ErrorOfImport(std::string(20000, '[')), HasSubstr("lab.yaml"));
  EXPECT_THAT(ErrorOfImport("Camera: &a {b: *a, fx: *a}\n"), HasSubstr("lab.yaml"));
  EXPECT_THAT(ErrorOfImport("? {a: b}\n: c\nCamera.fx: {x: 1}\n"), HasSubstr("lab.yaml"));
}

TEST_F(CameraImport, ReadsKittiCalibration) {
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

}  // namespace
}  // namespace dynamic_slam
