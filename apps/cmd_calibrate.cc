#include "cmd_calibrate.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/calibration/board_calibration.h"
#include "dynamic_slam/calibration/board_coverage.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/io/live_source.h"
#include "run_console.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

struct CalibrateArguments {
  std::string source, board;
  double square_m = 0;
  bool fisheye = false;
  std::string out = "camera.yaml";
  FrameSourceOptions source_options;
};

// A film shows the same view many times: more images than this are not searched.
constexpr size_t kMostImages = 300;
constexpr size_t kEnoughViews = 30;  // from a camera

// Grey and 8 bits, as the SLAM would see it.
ImagePreparer GreyPreparer(const cv::Size& size) {
  Camera any;
  any.width = size.width;
  any.height = size.height;
  any.fx = any.fy = size.width;
  any.cx = size.width / 2.0;
  any.cy = size.height / 2.0;
  return ImagePreparer(any, {});
}

// What cannot become a calibration is refused before anybody holds a board.
void CheckEnoughImages(const std::string& name, const FrameSource& source, int max_frames) {
  const size_t images = source.IsLive() ? static_cast<size_t>(max_frames) : source.FrameCount();
  if (images == 0 || images >= kMinCalibrationViews) return;  // 0: not known
  throw InputError(name, fmt::format("gives {} image{}", images, images == 1 ? "" : "s"),
                   fmt::format("A calibration needs {} with the board in different places, and better {}.",
                               kMinCalibrationViews, kEnoughViews));
}

// Ctrl-C ends the search; what was found until then counts.
BoardViews FindViews(const Board& board, const RunConsole& console, FrameSource* source) {
  BoardViews views(source->ImageSize());
  ImagePreparer preparer = GreyPreparer(source->ImageSize());
  const size_t every = std::max<size_t>(1, source->FrameCount() / kMostImages);
  size_t images = 0, searched = 0, found = 0;
  while (!console.ShouldStop()) {
    const std::optional<SourceImage> image = source->Next();
    if (!image.has_value()) break;
    if (images++ % every != 0) continue;
    ++searched;
    cv::Mat grey;
    preparer.Prepare(image->image, &grey);
    std::optional<BoardView> view = FindBoard(grey, board, image->name);
    if (!view.has_value()) continue;
    ++found;
    if (!views.Add(std::move(*view)) || !source->IsLive()) continue;
    // Whoever holds the board wants to know where next, and when it is enough.
    const std::string missing = BoardCoverage(views.views(), views.image_size()).Missing();
    fmt::print("view {}; not seen yet: {}\n", views.views().size(), missing.empty() ? "nothing" : missing);
    std::fflush(stdout);
    if (missing.empty() && views.views().size() >= kEnoughViews) break;
  }
  fmt::print("images    {} of {} searched, board in {} of them, {} views that differ\n", searched, images,
             found, views.views().size());
  for (const SourceProblem& problem : source->Problems())
    fmt::print("skipped   {}: {}\n", problem.name, problem.reason);
  return views;
}

std::string WriteCoverage(const BoardViews& views, const std::filesystem::path& camera_file) {
  std::filesystem::path file = camera_file;
  file.replace_filename(camera_file.stem().string() + "_coverage.png");
  std::vector<uchar> png;
  cv::imencode(".png", BoardCoverage(views.views(), views.image_size()).Draw(views.views()), png);
  WriteFileAtomically(file, std::string(png.begin(), png.end()));
  return file.string();
}

void Print(const BoardCalibration& calibration) {
  const Camera& c = calibration.camera;
  fmt::print("fx fy     {:.3f} {:.3f} px\ncx cy     {:.3f} {:.3f} px\n", c.fx, c.fy, c.cx, c.cy);
  if (c.model == LensModel::kKannalaBrandt) {
    fmt::print("k1 to k4  {:.5f} {:.5f} {:.5f} {:.5f}\n", c.k1, c.k2, c.k3, c.k4);
  } else {
    fmt::print("k1 k2     {:.5f} {:.5f}\np1 p2     {:.6f} {:.6f}\nk3        {:.5f}\n", c.k1, c.k2, c.p1, c.p2,
               c.k3);
  }
  fmt::print("error     {:.3f} px (root mean square of the reprojections)\n", calibration.error_px);
  for (const std::string& name : calibration.left_out)
    fmt::print("left out  {}: does not fit the others\n", name);
  constexpr double kGoodErrorPx = 0.5;
  if (calibration.error_px > kGoodErrorPx) {
    fmt::print("warning: more than {} px: is the board flat, and the right --fisheye or not chosen?\n",
               kGoodErrorPx);
  }
}

void RunCalibrate(const CalibrateArguments& arguments) {
  const Board board = ParseBoard(arguments.board, arguments.square_m);
  std::optional<RunConsole> console(true);  // a Ctrl-C after the capture ends the program
  FrameSourceOptions source_options = arguments.source_options;
  source_options.on_event = [&console](const std::string& event) { console->Say(event); };
  source_options.should_stop = [&console] { return console->ShouldStop(); };
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, source_options);
  CheckEnoughImages(WithoutPassword(arguments.source), *source, source_options.max_frames);
  CheckCanBeWritten(arguments.out);
  if (source->IsLive()) {
    fmt::print(
        "hold the board before the camera, in all parts of the image, tilted each way; Ctrl-C ends it\n");
    std::fflush(stdout);
  }
  const BoardViews views = FindViews(board, *console, source.get());
  console.reset();
  const std::string picture = WriteCoverage(views, arguments.out);
  fmt::print("coverage  {}\n", picture);
  BoardCalibration calibration = CalibrateBoard(
      views, board, arguments.fisheye ? LensModel::kKannalaBrandt : LensModel::kRadialTangential);
  const std::vector<std::string> missing = MissingForCalibration(views, calibration);
  if (!missing.empty()) {
    throw InputError(
        arguments.source, "does not show the board in enough ways for a camera that can be trusted",
        fmt::format("{}\n  {} shows in red where it was not seen.", fmt::join(missing, "\n  "), picture));
  }
  calibration.camera.name = std::filesystem::path(arguments.out).stem().string();
  Print(calibration);
  WriteCamera(arguments.out, calibration.camera);
  fmt::print("camera    {}\n", arguments.out);
}

}  // namespace

void AddCalibrateCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("calibrate", "Make a camera file from images of a chessboard");
  const auto arguments = std::make_shared<CalibrateArguments>();
  CalibrateArguments& a = *arguments;
  command
      ->add_option(
          "SOURCE", a.source,
          "Images of the board: folder, video, or camera:0, which ends when all was seen, or at Ctrl-C")
      ->required();
  command->add_option("--board", a.board, "Inner corners of the board: 9x6 has 10 by 7 squares")
      ->required()
      ->type_name("COLUMNSxROWS");
  command->add_option("--square", a.square_m, "Edge of a square, m")->required();
  command->add_flag("--fisheye", a.fisheye, "The lens is a fisheye (Kannala and Brandt's model)");
  command->add_option("--out", a.out, "Camera file; the picture of the coverage is written beside it")
      ->capture_default_str();
  AddSourceOptions(command, &a.source_options);
  command->footer(
      "Examples:\n"
      "  dynamic_slam calibrate board.mp4 --board 9x6 --square 0.025 --out my_camera.yaml\n"
      "  dynamic_slam calibrate photos --board 9x6 --square 0.025 --fisheye");
  command->callback([arguments] { RunCalibrate(*arguments); });
}

}  // namespace dynamic_slam
