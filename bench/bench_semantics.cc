// Time of the built-in detector, of the boxes' compensation and of the hand-off of detections, two people in
// view, as multiples of one ORB of OpenCV's that is measured in turns with them.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <numeric>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/semantics/detection_exchange.h"
#include "dynamic_slam/semantics/make_compensation.h"
#include "dynamic_slam/semantics/network_detector.h"

namespace dynamic_slam {
namespace {

constexpr double kFps = 30;

double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

Camera WebCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fps = kFps;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

// A texture with more corners than ORB wants.
cv::Mat Texture() {
  Random random(1);
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 400; ++i) {
    const cv::Rect rect(static_cast<int>(random.Index(640)), static_cast<int>(random.Index(480)),
                        4 + static_cast<int>(random.Index(60)), 4 + static_cast<int>(random.Index(60)));
    cv::rectangle(image, rect, cv::Scalar(random.Index(256)), cv::FILLED);
  }
  return image;
}

// Two people walk through each other and back, and 600 points are followed.
struct Scene {
  std::vector<Detection> detections;
  std::vector<PointMotion> motions;
};

Scene SceneAt(uint32_t frame) {
  Random random(frame);
  const double phase = 250 + 200 * std::sin(frame / 30.0);
  Scene scene;
  scene.detections = {{{phase, 90, 130, 380}, 0, 0.9}, {{500 - phase, 100, 120, 370}, 0, 0.8}};
  for (int i = 0; i < 600; ++i) {
    const Eigen::Vector2d from(random.Uniform(0, 640), random.Uniform(0, 480));
    scene.motions.push_back({from, from + Eigen::Vector2d(2, random.Uniform(-1, 1))});
  }
  return scene;
}

// The argument is by how many frames an answer comes late. As in a run, the detector is asked about one frame
// at a time. `ratio` is the mean of all frames, `ratio_late` that of the frames in which a late answer comes.
void BM_CompensationRatio(benchmark::State& state) {
  cv::setNumThreads(1);
  constexpr uint32_t kFramesPerOrb = 10;
  const uint32_t late = static_cast<uint32_t>(state.range(0));
  const cv::Mat image = Texture();
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2f, 8);
  const auto compensation = MakeBoxCompensation(CompensationOptions(), WebCamera());
  DetectionExchange exchange;
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<double> ours_s, late_s, orb_s;
  uint32_t asked = 0;
  uint32_t frame = 0;
  const auto hand_off = [&](uint32_t of, std::vector<Detection> detections) {
    exchange.Write({FrameId(of), std::move(detections), ""});
    return exchange.Read(FrameId(of), std::chrono::steady_clock::now())->detections;
  };
  for (auto _ : state) {
    for (uint32_t i = 0; i < kFramesPerOrb; ++i, ++frame) {
      Scene scene = SceneAt(frame);
      const bool comes = frame == asked + late;
      Scene seen = SceneAt(asked);
      const double start_s = ThreadSeconds();
      CompensationInput input{FrameId(frame), frame / kFps, {}, {}, std::move(scene.motions)};
      if (comes && late == 0) input.detections = hand_off(asked, std::move(seen.detections));
      if (comes && late > 0) {
        compensation->UpdateLate(FrameId(asked), hand_off(asked, std::move(seen.detections)));
      }
      benchmark::DoNotOptimize(compensation->Update(input));
      compensation->UpdateRotation(FrameId(frame), ExpSo3({0.001, 0.002, 0}));
      ours_s.push_back(ThreadSeconds() - start_s);
      if (comes) {
        late_s.push_back(ours_s.back());
        asked = late == 0 ? frame + 1 : frame;
      }
    }
    const double start_s = ThreadSeconds();
    orb->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
    orb_s.push_back(ThreadSeconds() - start_s);
  }
  const double one_orb_s = Median(&orb_s);
  state.counters["ours_ms"] = 1e3 * Mean(ours_s);
  state.counters["orb_ms"] = 1e3 * one_orb_s;
  state.counters["ratio"] = Mean(ours_s) / one_orb_s;
  state.counters["ratio_late"] = Mean(late_s) / one_orb_s;
}
BENCHMARK(BM_CompensationRatio)->Arg(0)->Arg(3)->Arg(15)->Unit(benchmark::kMillisecond);

// All of a detection, from the image to its boxes.
void BM_BuiltinDetectorRatio(benchmark::State& state) {
  const auto detector =
      MakeNetworkDetector(ReadDetectorFile(FindConfig("detectors", "detector", "builtin")), {});
  cv::setNumThreads(1);
  const cv::Mat image = Texture();
  cv::Mat colour;
  cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2f, 8);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<double> ours_s, orb_s;
  for (auto _ : state) {
    const double start_s = ThreadSeconds();
    benchmark::DoNotOptimize(detector->Detect(colour, FrameId(0), 0));
    ours_s.push_back(ThreadSeconds() - start_s);
    orb->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
    orb_s.push_back(ThreadSeconds() - start_s - ours_s.back());
  }
  const double one_orb_s = Median(&orb_s), one_s = Median(&ours_s);
  state.counters["ours_ms"] = 1e3 * one_s;
  state.counters["orb_ms"] = 1e3 * one_orb_s;
  state.counters["ratio"] = one_s / one_orb_s;
}
BENCHMARK(BM_BuiltinDetectorRatio)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dynamic_slam
