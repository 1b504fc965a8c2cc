#include "dynamic_slam/io/frame_source.h"

#include <algorithm>
#include <vector>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/source_layout.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Frame `value` of a made sequence: all pixels have that grey level.
cv::Mat Image(int value, cv::Size size = {64, 48}) { return {size, CV_8UC1, cv::Scalar(value)}; }

class FrameSourceTest : public FolderTest {
 protected:
  void WriteImage(const std::string& name, const cv::Mat& image) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), image));
  }

  // Cuts a file to a part of its length.
  void Truncate(const std::string& name) const {
    std::filesystem::resize_file(folder_ / name, std::filesystem::file_size(folder_ / name) / 2);
  }

  // rgb.txt for images 0, 1, ... with a stamp of 10 + i / 10.
  void WriteTum(int count) const {
    std::string index = "# color images\n# timestamp filename\n";
    for (int i = 0; i < count; ++i) {
      const std::string name = fmt::format("rgb/{}.png", i);
      WriteImage(name, Image(i));
      index += fmt::format("{:.6f} {}\n", 10 + 0.1 * i, name);
    }
    Write("rgb.txt", index);
  }

  std::string OpenError(const std::string& name, const FrameSourceOptions& options = {}) const {
    return ErrorOf([&] { OpenFrameSource(folder_ / name, options); });
  }
};

// The grey level of each image that the source yields.
std::vector<int> Levels(FrameSource* source) {
  std::vector<int> levels;
  while (const auto image = source->Next()) {
    EXPECT_EQ(image->image.depth(), CV_8U);
    levels.push_back(image->image.ptr(5)[5 * image->image.channels()]);
  }
  return levels;
}

std::vector<std::string> ProblemTexts(const FrameSource& source) {
  std::vector<std::string> texts;
  for (const SourceProblem& problem : source.Problems())
    texts.push_back(problem.name + ": " + problem.reason);
  return texts;
}

TEST_F(FrameSourceTest, ReadsTum) {
  WriteTum(3);
  const auto source = OpenFrameSource(folder_);
  EXPECT_EQ(source->Layout(), "tum");
  EXPECT_EQ(source->FrameCount(), 3u);
  EXPECT_EQ(source->ImageSize(), cv::Size(64, 48));
  EXPECT_FALSE(source->OwnCamera().has_value());
  const auto first = source->Next();
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->timestamp_s, 10.0);
  EXPECT_EQ(first->name, "rgb/0.png");
  EXPECT_THAT(Levels(source.get()), ElementsAre(1, 2));
  EXPECT_FALSE(source->Next().has_value());
  EXPECT_THAT(source->Problems(), IsEmpty());
}

TEST_F(FrameSourceTest, GivesImagesAsTheyAreStored) {
  WriteImage("a/0.png", cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 20, 30)));
  WriteImage("a/1.png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(4000)));
  WriteImage("a/2.png", Image(7));
  const auto source = OpenFrameSource(folder_ / "a");
  EXPECT_EQ(source->Next()->image.at<cv::Vec3b>(5, 5), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(source->Next()->image.at<uint16_t>(5, 5), 4000);
  EXPECT_EQ(source->Next()->image.type(), CV_8UC1);
}

TEST_F(FrameSourceTest, StartAndMaxFrames) {
  WriteTum(6);
  Truncate("rgb/0.png");
  const auto source = OpenFrameSource(folder_, {.start = 2, .max_frames = 3});
  EXPECT_EQ(source->FrameCount(), 3u);
  EXPECT_THAT(Levels(source.get()), ElementsAre(2, 3, 4));
  EXPECT_THAT(source->Problems(), IsEmpty());  // the broken one was never decoded
  EXPECT_EQ(OpenFrameSource(folder_, {.start = 4, .max_frames = 30})->FrameCount(), 2u);
  EXPECT_THAT(OpenError("", {.start = 6}), HasSubstr("--start 6 skips all of its 6 frames"));
  EXPECT_THAT(OpenError("", {.start = -1}), HasSubstr("none may be negative"));
}

TEST_F(FrameSourceTest, SkipsAndRemembersBadFrames) {
  WriteTum(4);
  WriteImage("rgb/4.jpg", Image(200, {640, 480}));
  WriteImage("rgb/big.png", Image(9, {65, 48}));
  Truncate("rgb/1.png");
  Truncate("rgb/4.jpg");
  Write("rgb/empty.png", "");
  Write("rgb/text.png", "this is not an image");
  Write("rgb.txt",
        "1 rgb/0.png\n2 rgb/1.png\n3 rgb/absent.png\n4 rgb/2.png\n3.5 rgb/3.png\n4 rgb/3.png\n5 rgb/4.jpg\n"
        "6 rgb/empty.png\n7 rgb/text.png\n8 rgb/big.png\nwhat is this\n9 rgb/3.png\n");
  const auto source = OpenFrameSource(folder_);
  EXPECT_EQ(source->FrameCount(), 12u);
  EXPECT_THAT(Levels(source.get()), ElementsAre(0, 2, 3));
  EXPECT_THAT(ProblemTexts(*source),
              ElementsAre("rgb/1.png: the image is truncated", "rgb/absent.png: the file is missing",
                          "rgb/3.png: its stamp 3.500000 goes back behind 4.000000",
                          "rgb/3.png: its stamp 4.000000 is a duplicate", "rgb/4.jpg: the image is truncated",
                          "rgb/empty.png: the file is empty", "rgb/text.png: the image cannot be decoded",
                          "rgb/big.png: its size is 65 x 48 px, that of the first image 64 x 48 px",
                          "rgb.txt:11: 'what is this' is not 'timestamp file'"));
}

TEST_F(FrameSourceTest, ImagesOfAnySizeWhereTheyAreWanted) {
  WriteImage("a.png", Image(1));
  WriteImage("b.png", Image(2, {65, 48}));
  WriteImage("c.png", Image(3));
  EXPECT_THAT(Levels(OpenFrameSource(folder_).get()), ElementsAre(1, 3));
  EXPECT_THAT(Levels(OpenFrameSource(folder_, {.any_size = true}).get()), ElementsAre(1, 2, 3));
}

TEST_F(FrameSourceTest, AStampThatIsNoTimeCostsOneFrame) {
  WriteTum(8);
  Write(
      "rgb.txt",
      "1 rgb/0.png\nnan rgb/1.png\n2 rgb/1.png\n1e12 rgb/2.png\n2e12 rgb/3.png\ninf rgb/3.png\n3 rgb/4.png\n"
      "4 rgb/5.png\n5 rgb/6.png\n6 rgb/7.png\n");
  const auto source = OpenFrameSource(folder_);
  EXPECT_THAT(Levels(source.get()), ElementsAre(0, 1, 4, 5, 6, 7));
  EXPECT_THAT(ProblemTexts(*source),
              ElementsAre("rgb.txt:2: 'nan rgb/1.png' is not 'timestamp file'",
                          "rgb/2.png: its stamp 1000000000000.000000 is ahead of those that follow",
                          "rgb/3.png: its stamp 2000000000000.000000 is ahead of those that follow",
                          "rgb.txt:6: 'inf rgb/3.png' is not 'timestamp file'"));
}

TEST_F(FrameSourceTest, AClockThatStartsAgainEndsTheSequence) {
  WriteTum(8);
  Write("rgb.txt",
        "5 rgb/0.png\n6 rgb/1.png\n7 rgb/2.png\n8 rgb/3.png\n9 rgb/4.png\n0 rgb/5.png\n1 rgb/6.png\n"
        "2 rgb/7.png\n");
  const auto source = OpenFrameSource(folder_);
  EXPECT_THAT(Levels(source.get()), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(source->Problems().size(), 3u);
}

TEST_F(FrameSourceTest, ABrokenFirstFrameIsSkippedToo) {
  WriteTum(3);
  Truncate("rgb/0.png");
  const auto source = OpenFrameSource(folder_);
  EXPECT_EQ(source->ImageSize(), cv::Size(64, 48));
  EXPECT_THAT(Levels(source.get()), ElementsAre(1, 2));
  EXPECT_EQ(source->Problems().size(), 1u);
}

TEST_F(FrameSourceTest, HopelessSourcesThrow) {
  EXPECT_THAT(OpenError("absent"), HasSubstr("there is no such file or folder"));
  EXPECT_THAT(OpenError(""), HasSubstr("no known layout"));
  EXPECT_THAT(OpenError(""), HasSubstr("Known are: TUM RGB-D"));
  Write("tum/rgb.txt", "# only a comment\n");
  EXPECT_THAT(OpenError("tum"), HasSubstr("lists no image"));
  Write("tum/rgb.txt", "1 rgb/0.png\n2 rgb/1.png\n");
  EXPECT_THAT(OpenError("tum"),
              HasSubstr("no image of it can be read (first: rgb/0.png: the file is missing)"));
  Write("no_video.mp4", "this is not a video");
  EXPECT_THAT(OpenError("no_video.mp4"), HasSubstr("is not a video that can be read"));
  EXPECT_THAT(OpenError("tum/rgb.txt"), HasSubstr("Give the folder of a sequence"));
  WriteImage("photo.PNG", Image(1));
  EXPECT_THAT(OpenError("photo.PNG"), HasSubstr("photo.PNG: is a single image"));
  WriteImage("set/sequences/00/image_0/000000.png", Image(1));
  EXPECT_THAT(OpenError("set"), HasSubstr("give one sequence of it, such as sequences/00"));
  EXPECT_THAT(OpenError("set/sequences/00"), HasSubstr("times.txt: is missing"));
  WriteImage("half/rgb/0.png", Image(1));
  EXPECT_THAT(OpenError("half"), HasSubstr("rgb.txt is missing"));
}

TEST_F(FrameSourceTest, ReadsKitti) {
  std::string times;
  for (int i = 0; i < 5; ++i) {
    if (i != 2) WriteImage(fmt::format("image_0/{:06}.png", i), Image(i));
    times += fmt::format("{:.6e}\n", 0.1 * i);
  }
  Write("times.txt", times);
  Write("calib.txt", "P0: 70 0 30 0 0 71 20 0 0 0 1 0\n");
  const auto source = OpenFrameSource(folder_);
  EXPECT_EQ(source->Layout(), "kitti");
  EXPECT_EQ(source->FrameCount(), 5u);
  const auto camera = source->OwnCamera();
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->fy, 71);
  EXPECT_EQ(camera->width, 64);
  EXPECT_NEAR(camera->fps, 10, 1e-9);
  EXPECT_THAT(Levels(source.get()), ElementsAre(0, 1, 3, 4));
  EXPECT_THAT(ProblemTexts(*source), ElementsAre("000002.png: the file is missing"));
}

TEST_F(FrameSourceTest, KittiSaysWhenStampsAndImagesDiffer) {
  for (int i = 0; i < 3; ++i) WriteImage(fmt::format("image_0/{:06}.png", i), Image(i));
  Write("times.txt", "0\n0.1\n");
  const auto source = OpenFrameSource(folder_);
  EXPECT_THAT(Levels(source.get()), ElementsAre(0, 1));
  EXPECT_THAT(ProblemTexts(*source),
              ElementsAre("times.txt: has 2 stamps for 3 images; only the first 2 are used"));
}

TEST_F(FrameSourceTest, ReadsEurocFromEachOfItsFolders) {
  Write("mav0/cam0/data.csv",
        "#timestamp [ns],filename\r\n1403636579763555584,1403636579763555584.png\r\n"
        "1403636579813555456,1403636579813555456.png\r\n");
  WriteImage("mav0/cam0/data/1403636579763555584.png", Image(1));
  WriteImage("mav0/cam0/data/1403636579813555456.png", Image(2));
  Write("mav0/cam0/sensor.yaml",
        "rate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [50, 51, 32, 24]\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n");
  for (const char* name : {"", "mav0", "mav0/cam0"}) {
    const auto source = OpenFrameSource(folder_ / name);
    EXPECT_EQ(source->Layout(), "euroc");
    EXPECT_EQ(source->OwnCamera()->fy, 51) << name;
    EXPECT_NEAR(source->Next()->timestamp_s, 1403636579.763555584, 1e-6);
    EXPECT_THAT(Levels(source.get()), ElementsAre(2));
  }
}

TEST_F(FrameSourceTest, ALineOfEurocWithoutStampOrFileCostsOneFrame) {
  Write("mav0/cam0/data.csv", ",\n1403636579763555584,one.png\n,,\n1403636579813555456\n");
  WriteImage("mav0/cam0/data/one.png", Image(1));
  const auto source = OpenFrameSource(folder_);
  EXPECT_THAT(Levels(source.get()), ElementsAre(1));
  ASSERT_EQ(source->Problems().size(), 3u);
  EXPECT_EQ(source->Problems()[0].name, "data.csv:1");
  EXPECT_EQ(source->Problems()[0].reason, "',' is not 'nanoseconds,file'");
}

TEST_F(FrameSourceTest, ReadsImagesInNaturalOrderAtTheGivenRate) {
  for (const int i : {1, 2, 10}) WriteImage(fmt::format("img{}.png", i), Image(i));
  Write("notes.txt", "not an image");
  const auto source = OpenFrameSource(folder_, {.fps = 20});
  EXPECT_EQ(source->Layout(), "images");
  EXPECT_EQ(source->Next()->timestamp_s, 0);
  EXPECT_EQ(source->Next()->timestamp_s, 0.05);
  EXPECT_THAT(Levels(source.get()), ElementsAre(10));
}

TEST_F(FrameSourceTest, CameraFileInTheFolderIsItsOwnCamera) {
  WriteTum(1);
  Write("camera.yaml", "width: 64\nheight: 48\nfx: 50\nfy: 50\ncx: 32\ncy: 24\n");
  EXPECT_EQ(OpenFrameSource(folder_)->OwnCamera()->fx, 50);
  Write("camera.yaml", "width: 64\n");
  EXPECT_THAT(ErrorOf([&] { OpenFrameSource(folder_)->OwnCamera(); }), HasSubstr("the key 'fx' is missing"));
}

TEST_F(FrameSourceTest, ReadsVideo) {
  const std::string file = (folder_ / "a.avi").string();
  {
    cv::VideoWriter writer(file, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
    if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV cannot write a video";
    for (int i = 0; i < 6; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  }
  const auto source = OpenFrameSource(file, {.start = 2, .max_frames = 3});
  EXPECT_EQ(source->Layout(), "video");
  EXPECT_EQ(source->FrameCount(), 3u);
  const auto first = source->Next();
  ASSERT_TRUE(first.has_value());
  EXPECT_NEAR(first->timestamp_s, 2 / 25.0, 1e-12);
  EXPECT_EQ(first->name, "frame 2");
  const std::vector<int> levels = Levels(source.get());
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_NEAR(levels[0], 120, 4);
  EXPECT_NEAR(levels[1], 160, 4);
  EXPECT_NEAR(OpenFrameSource(file, {.fps = 10, .start = 1})->Next()->timestamp_s, 0.1, 1e-12);
}

TEST(NaturalLess, OrdersNumbersByValue) {
  std::vector<std::string> names = {"b1", "a10", "a2", "a02b", "a", "a1.5", "a1.10", "A3"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_THAT(names, ElementsAre("A3", "a", "a1.5", "a1.10", "a2", "a02b", "a10", "b1"));
  EXPECT_TRUE(NaturalLess("a01", "a1") != NaturalLess("a1", "a01"));
  EXPECT_FALSE(NaturalLess("a1", "a1"));
}

TEST_F(FrameSourceTest, ReadsTheSharedData) {
  if (SharedData().empty()) GTEST_SKIP() << "DYNAMIC_SLAM_DATA is not set";
  const struct {
    const char *folder, *layout;
    size_t frames;
    cv::Size size;
  } cases[] = {{"tum_fr1_desk", "tum", 613, {640, 480}},
               {"tum_fr1_desk_walk", "tum", 613, {640, 480}},
               {"sevenscenes_redkitchen", "tum", 400, {640, 480}},
               {"kitti_00_first200/sequences/00", "kitti", 200, {1241, 376}},
               {"tum_fr3_walking_halfsphere_10", "images", 10, {640, 480}}};
  for (const auto& c : cases) {
    const auto source = OpenFrameSource(SharedData() / c.folder);
    EXPECT_EQ(source->Layout(), c.layout);
    EXPECT_EQ(source->FrameCount(), c.frames) << c.folder;
    EXPECT_EQ(source->ImageSize(), c.size);
    size_t read = 0;
    while (source->Next()) ++read;
    EXPECT_EQ(read, c.frames) << c.folder;
    EXPECT_THAT(ProblemTexts(*source), IsEmpty());
  }
  const auto camera = OpenFrameSource(SharedData() / "kitti_00_first200/sequences/00")->OwnCamera();
  EXPECT_EQ(camera->fx, 718.856);
  EXPECT_NEAR(camera->fps, 10, 0.5);
  EXPECT_EQ(camera->k1, LoadCamera("kitti_00-02").k1);  // which its calib.txt lacks
  EXPECT_GT(camera->k1, 0);
}

}  // namespace
}  // namespace dynamic_slam
