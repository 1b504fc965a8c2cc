// Time of the ORB extractor beside that of OpenCV's on the same images, and their ratio; of its parts, of
// matching and of the place index. Absolute times do not transfer between machines; ratios do, roughly.
//
// With DYNAMIC_SLAM_DATA set the images are frames of tum_fr1_desk, else drawn textures.

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <numeric>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/downscaler.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/features/orb_extractor.h"
#include "dynamic_slam/features/place_index.h"

namespace dynamic_slam {
namespace {

cv::Mat DrawTexture(uint64_t seed) {
  Random random(seed);
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 400; ++i) {
    const cv::Rect rect(static_cast<int>(random.Index(640)), static_cast<int>(random.Index(480)),
                        4 + static_cast<int>(random.Index(60)), 4 + static_cast<int>(random.Index(60)));
    cv::rectangle(image, rect, cv::Scalar(random.Index(256)), cv::FILLED);
  }
  cv::GaussianBlur(image, image, {}, 0.8);
  for (uint8_t& value : cv::Mat_<uint8_t>(image))
    value = cv::saturate_cast<uint8_t>(value + 2 * random.Gaussian());
  return image;
}

const std::vector<cv::Mat>& Images() {
  static const std::vector<cv::Mat> images = [] {
    constexpr size_t kCount = 30;
    std::vector<cv::Mat> result;
    if (const char* data = std::getenv("DYNAMIC_SLAM_DATA")) {
      std::vector<std::string> paths;
      std::error_code missing;
      for (const auto& entry :
           std::filesystem::directory_iterator(std::filesystem::path(data) / "tum_fr1_desk/rgb", missing)) {
        paths.push_back(entry.path().string());
      }
      std::sort(paths.begin(), paths.end());
      for (size_t i = 0; i < kCount && !paths.empty(); ++i) {
        const cv::Mat image = cv::imread(paths[i * paths.size() / kCount], cv::IMREAD_GRAYSCALE);
        if (!image.empty()) result.push_back(image);
      }
    }
    for (uint64_t seed = 0; result.size() < kCount; ++seed) result.push_back(DrawTexture(seed));
    return result;
  }();
  return images;
}

Camera BenchCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 517.3;
  camera.fy = 516.5;
  camera.cx = 318.6;
  camera.cy = 255.3;
  camera.k1 = 0.26;
  camera.k2 = -0.95;
  camera.k3 = 1.16;
  return camera;
}

class Ours {
 public:
  explicit Ours(int features) : extractor_(Options(features), BenchCamera()) {}
  void operator()(const cv::Mat& image) { extractor_.Extract(image, cv::Mat(), &features_); }

 private:
  static OrbOptions Options(int features) {
    OrbOptions options;
    options.features = features;
    return options;
  }
  OrbExtractor extractor_;
  FeatureSet features_;
};

class OpenCv {
 public:
  explicit OpenCv(int features) : orb_(cv::ORB::create(features, 1.2f, 8)) {}
  void operator()(const cv::Mat& image) {
    orb_->detectAndCompute(image, cv::noArray(), keypoints_, descriptors_);
  }

 private:
  cv::Ptr<cv::ORB> orb_;
  std::vector<cv::KeyPoint> keypoints_;
  cv::Mat descriptors_;
};

template <class Extractor>
void BM_Orb(benchmark::State& state) {
  cv::setNumThreads(1);
  const std::vector<cv::Mat>& images = Images();
  Extractor extract(static_cast<int>(state.range(0)));
  size_t i = 0;
  for (auto _ : state) extract(images[i++ % images.size()]);
}
BENCHMARK_TEMPLATE(BM_Orb, Ours)->Arg(1000)->Arg(2000)->Arg(5000)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(BM_Orb, OpenCv)->Arg(1000)->Arg(2000)->Arg(5000)->Unit(benchmark::kMillisecond);

void BM_Pyramid(benchmark::State& state) {
  const std::vector<cv::Mat>& images = Images();
  std::vector<cv::Mat> levels(8);
  std::vector<Downscaler> downscalers;
  double scale = 1;
  for (size_t i = 0; i < levels.size(); ++i, scale *= 1.2) {
    levels[i].create(cvRound(480 / scale), cvRound(640 / scale), CV_8UC1);
    if (i > 0) downscalers.emplace_back(levels[i - 1].size(), levels[i].size());
  }
  size_t next = 0;
  for (auto _ : state) {
    levels[0] = images[next++ % images.size()];
    for (size_t i = 1; i < levels.size(); ++i) downscalers[i - 1].Run(levels[i - 1], &levels[i]);
  }
}
BENCHMARK(BM_Pyramid)->Unit(benchmark::kMillisecond);

// Features of an image, and a turned copy of their descriptors to look for: N windows of 15 px.
void BM_FindInWindow(benchmark::State& state) {
  FeatureSet features;
  OrbOptions options;
  OrbExtractor(options, BenchCamera()).Extract(Images().front(), {}, &features);
  KeypointGrid grid;
  grid.Build(features, BenchCamera().IdealBounds());
  for (auto _ : state) {
    size_t found = 0;
    for (size_t i = 0; i < features.size(); ++i) {
      const Keypoint& keypoint = features.keypoints[i];
      const SearchWindow window{keypoint.x + 3, keypoint.y - 3, 15, keypoint.octave - 1, keypoint.octave + 1};
      found += FindInWindow(features, grid, window, features.descriptors[i], {}).Found();
    }
    benchmark::DoNotOptimize(found);
  }
  state.counters["windows"] = static_cast<double>(features.size());
}
BENCHMARK(BM_FindInWindow)->Unit(benchmark::kMillisecond);

// All descriptors of one image against all of another, both ways.
void BM_MatchMutual(benchmark::State& state) {
  std::array<FeatureSet, 2> features;
  std::array<std::vector<uint32_t>, 2> all;
  OrbExtractor extractor({}, BenchCamera());
  for (size_t i = 0; i < 2; ++i) {
    extractor.Extract(Images()[i], {}, &features[i]);
    all[i].resize(features[i].size());
    std::iota(all[i].begin(), all[i].end(), 0u);
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(MatchMutual(features[0], all[0], features[1], all[1], kLooseDistance, 0.8));
  }
}
BENCHMARK(BM_MatchMutual)->Unit(benchmark::kMillisecond);

// A question to an index of N keyframes.
void BM_PlaceQuery(benchmark::State& state) {
  const std::vector<cv::Mat>& images = Images();
  OrbExtractor extractor({}, BenchCamera());
  PlaceIndex index;
  std::vector<std::vector<uint64_t>> words;
  for (const cv::Mat& image : images) {
    FeatureSet features;
    extractor.Extract(image, {}, &features);
    words.push_back(PlaceWords(features, {}, 0.5f));
  }
  for (uint32_t i = 0; i < static_cast<uint32_t>(state.range(0)); ++i) {
    index.Add(KeyframeId(i), words[i % words.size()]);
  }
  size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(index.Query(words[next++ % words.size()]));
}
BENCHMARK(BM_PlaceQuery)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);

double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// The counter `ratio` is the median of ours over the median of OpenCV's, in time of this thread and in turns:
// what else the machine does meets both alike.
void BM_OrbRatio(benchmark::State& state) {
  cv::setNumThreads(1);
  const std::vector<cv::Mat>& images = Images();
  Ours ours(static_cast<int>(state.range(0)));
  OpenCv opencv(static_cast<int>(state.range(0)));
  std::vector<double> ours_s, opencv_s;
  const auto time = [](auto& extract, const cv::Mat& image) {
    const double start_s = ThreadSeconds();
    extract(image);
    return ThreadSeconds() - start_s;
  };
  for (auto _ : state) {
    for (const cv::Mat& image : images) {
      ours_s.push_back(time(ours, image));
      opencv_s.push_back(time(opencv, image));
    }
  }
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(values.size() / 2),
                     values.end());
    return values[values.size() / 2];
  };
  state.counters["ours_ms"] = 1e3 * median(ours_s);
  state.counters["opencv_ms"] = 1e3 * median(opencv_s);
  state.counters["ratio"] = median(ours_s) / median(opencv_s);
}
BENCHMARK(BM_OrbRatio)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dynamic_slam
