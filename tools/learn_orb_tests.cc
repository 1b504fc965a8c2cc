// Chooses the 256 binary tests of the ORB descriptor and prints them as
// src/dynamic_slam/features/orb_tests.inc.
//
// As in Rublee et al. (2011), sec. 4.3: from a large pool of random tests with a mean near 0.5, greedily take
// the best ones that correlate little with those taken before. Here two views of each keypoint are known, so
// that a test is good when it seldom changes between the views of one keypoint, compared to how often it
// differs between keypoints.
//
// The training images are drawn at random by this program: no photograph has a part in the result. It is the
// same on every run (a minute).

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/orb_extractor.h"
#include "dynamic_slam/features/steered_brief.h"

namespace dynamic_slam {
namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr int kTests = 256;
// Patches are turned so that they get brighter to the right. Without this limit tests win that only repeat
// it, and descriptors of different places differ in 94 bits in the mean instead of 123.
constexpr double kMeanTolerance = 0.1;

cv::Scalar RandomGrey(Random& random) { return cv::Scalar(random.Uniform(0, 256)); }

cv::Point RandomPoint(Random& random) {
  return {static_cast<int>(random.Index(kWidth)), static_cast<int>(random.Index(kHeight))};
}

// Smooth noise of several sizes of grain, under shapes, lines and letters of all sizes and contrasts.
cv::Mat DrawImage(Random& random) {
  cv::Mat image(kHeight, kWidth, CV_32F, RandomGrey(random));
  for (int grain = 64; grain >= 2; grain /= 2) {
    cv::Mat noise(kHeight / grain + 2, kWidth / grain + 2, CV_32F), large;
    const double strength = random.Uniform(0, 1) * 4 * std::sqrt(grain);
    for (float& value : cv::Mat_<float>(noise)) value = static_cast<float>(strength * random.Gaussian());
    cv::resize(noise, large, image.size(), 0, 0, cv::INTER_CUBIC);
    image += large;
  }
  const int shapes = 100 + static_cast<int>(random.Index(300));
  for (int i = 0; i < shapes; ++i) {
    const int size = static_cast<int>(4 * std::pow(40.0, random.Uniform()));  // 4 to 160 px
    const cv::Point at = RandomPoint(random);
    const auto near = [&] {
      return at + cv::Point(static_cast<int>(size * random.Gaussian()),
                            static_cast<int>(size * random.Gaussian()));
    };
    const cv::Scalar grey = RandomGrey(random);
    const int thickness = 1 + static_cast<int>(random.Index(5));
    switch (random.Index(5)) {
      case 0: {
        const std::vector<cv::Point> polygon = {near(), near(), near()};
        cv::fillConvexPoly(image, polygon, grey, cv::LINE_8);
        break;
      }
      case 1: {
        std::vector<cv::Point2f> corners(4);
        cv::RotatedRect(cv::Point2f(at), cv::Size2f(size, static_cast<float>(size * random.Uniform(0.2, 1))),
                        static_cast<float>(random.Uniform(0, 360)))
            .points(corners.data());
        cv::fillConvexPoly(image, std::vector<cv::Point>(corners.begin(), corners.end()), grey, cv::LINE_8);
        break;
      }
      case 2:
        cv::ellipse(image, at, {size, std::max(2, size / 2)}, random.Uniform(0, 360), 0, 360, grey,
                    random.Index(2) ? -1 : thickness);
        break;
      case 3:
        cv::line(image, at, near(), grey, thickness);
        break;
      default: {
        std::string word;
        for (uint32_t n = 2 + random.Index(8); n > 0; --n) word += static_cast<char>('!' + random.Index(90));
        cv::putText(image, word, at, static_cast<int>(random.Index(8)), size / 30.0, grey, thickness);
      }
    }
  }
  cv::GaussianBlur(image, image, {}, random.Uniform(0.5, 1.5));
  return image;
}

// What a camera makes of it: contrast, noise, 8 bits.
cv::Mat Photograph(const cv::Mat& image, Random& random) {
  const double gain = random.Uniform(0.6, 1.0), offset = random.Uniform(0, 50), noise = random.Uniform(1, 4);
  cv::Mat photograph(image.size(), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      photograph.at<uint8_t>(y, x) =
          cv::saturate_cast<uint8_t>(gain * image.at<float>(y, x) + offset + noise * random.Gaussian());
    }
  }
  return photograph;
}

// The places in a patch that tests may compare.
std::vector<cv::Point> PatchPoints(int radius) {
  std::vector<cv::Point> points;
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      if (x * x + y * y <= radius * radius) points.emplace_back(x, y);
    }
  }
  return points;
}

struct View {
  std::vector<Keypoint> keypoints;
  std::vector<std::vector<uint8_t>> patches;  // per keypoint: the grey values at the patch points
};

View Observe(const cv::Mat& photograph, const std::vector<cv::Point>& points, OrbExtractor* extractor) {
  View view;
  FeatureSet features;
  extractor->Extract(photograph, cv::Mat(), &features);
  std::vector<cv::Mat> blurred;
  for (const float scale : extractor->OctaveScales()) {
    cv::Mat level;
    cv::resize(photograph, level, {cvRound(kWidth / scale), cvRound(kHeight / scale)}, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(level, level, {}, 1.73);  // as much as SmoothMore(Smooth())
    blurred.push_back(level);
  }
  for (const Keypoint& keypoint : features.keypoints) {
    const cv::Mat& level = blurred[keypoint.octave];
    const double scale = extractor->OctaveScales()[keypoint.octave];
    const int x = cvRound((keypoint.raw_x + 0.5) / scale - 0.5),
              y = cvRound((keypoint.raw_y + 0.5) / scale - 0.5);
    const double c = std::cos(keypoint.angle_rad), s = std::sin(keypoint.angle_rad);
    std::vector<uint8_t> patch;
    bool inside = true;
    for (const cv::Point& point : points) {
      const int px = x + cvRound(c * point.x - s * point.y), py = y + cvRound(s * point.x + c * point.y);
      inside = inside && px >= 0 && py >= 0 && px < level.cols && py < level.rows;
      patch.push_back(inside ? level.at<uint8_t>(py, px) : 0);
    }
    if (!inside) continue;
    view.keypoints.push_back(keypoint);
    view.patches.push_back(std::move(patch));
  }
  return view;
}

// Grey values by patch point, then by keypoint: the same keypoints seen twice.
struct TrainingSet {
  std::vector<std::vector<uint8_t>> first, second;
  size_t size() const { return first[0].size(); }
};

TrainingSet MakeTrainingSet(const std::vector<cv::Point>& points, int images, Random& random) {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  OrbExtractor extractor(OrbOptions(), camera);
  TrainingSet set;
  set.first.resize(points.size());
  set.second.resize(points.size());
  for (int i = 0; i < images; ++i) {
    const cv::Mat image = DrawImage(random);
    cv::Mat warp = cv::getRotationMatrix2D({kWidth / 2.0f, kHeight / 2.0f}, random.Uniform(-40, 40),
                                           random.Uniform(0.8, 1.25));
    warp.at<double>(0, 0) *= random.Uniform(0.85, 1.15);
    warp.at<double>(0, 2) += random.Uniform(-20, 20);
    cv::Mat warped;
    cv::warpAffine(image, warped, warp, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
    const View a = Observe(Photograph(image, random), points, &extractor);
    const View b = Observe(Photograph(warped, random), points, &extractor);
    const double warp_scale = std::sqrt(std::abs(cv::determinant(warp.colRange(0, 2))));
    for (size_t j = 0; j < a.keypoints.size(); ++j) {
      const Keypoint& from = a.keypoints[j];
      const cv::Mat to = warp * (cv::Mat_<double>(3, 1) << from.raw_x, from.raw_y, 1);
      for (size_t k = 0; k < b.keypoints.size(); ++k) {
        const double scale = extractor.OctaveScales()[b.keypoints[k].octave];
        const double from_scale = extractor.OctaveScales()[from.octave] * warp_scale;
        const double distance =
            std::hypot(b.keypoints[k].raw_x - to.at<double>(0), b.keypoints[k].raw_y - to.at<double>(1));
        if (distance > 1.5 * scale || std::abs(std::log(scale / from_scale)) > std::log(1.2)) continue;
        for (size_t p = 0; p < points.size(); ++p) {
          set.first[p].push_back(a.patches[j][p]);
          set.second[p].push_back(b.patches[k][p]);
        }
        break;
      }
    }
  }
  return set;
}

struct Test {
  int first, second;           // indices of patch points
  std::vector<uint64_t> bits;  // its result for each keypoint of the training set
  size_t ones = 0;
  double cost = 0;  // changes between two views of a keypoint / changes between two keypoints
};

void Evaluate(const TrainingSet& set, Test* test) {
  const size_t count = set.size();
  test->bits.assign((count + 63) / 64, 0);
  size_t changed = 0;
  for (size_t i = 0; i < count; ++i) {
    const bool a = set.first[test->first][i] < set.first[test->second][i];
    const bool b = set.second[test->first][i] < set.second[test->second][i];
    test->bits[i / 64] |= static_cast<uint64_t>(a) << (i % 64);
    test->ones += a;
    changed += a != b;
  }
  const double mean = static_cast<double>(test->ones) / static_cast<double>(count);
  test->cost = static_cast<double>(changed) / static_cast<double>(count) / (2 * mean * (1 - mean) + 1e-9);
}

double Correlation(const Test& a, const Test& b, size_t count) {
  size_t both = 0;
  for (size_t i = 0; i < a.bits.size(); ++i)
    both += static_cast<size_t>(std::popcount(a.bits[i] & b.bits[i]));
  const double n = static_cast<double>(count);
  const double mean_a = static_cast<double>(a.ones) / n, mean_b = static_cast<double>(b.ones) / n;
  return (static_cast<double>(both) / n - mean_a * mean_b) /
         std::sqrt(mean_a * (1 - mean_a) * mean_b * (1 - mean_b) + 1e-12);
}

// pool: best first. Takes tests whose correlation with all taken ones is below a limit, and finds the lowest
// limit that lets kTests pass.
std::vector<size_t> Choose(const std::vector<Test>& pool, size_t count) {
  std::vector<size_t> chosen;
  for (double limit = 0.16; chosen.size() < kTests; limit += 0.02) {
    chosen.clear();
    for (size_t i = 0; i < pool.size() && chosen.size() < kTests; ++i) {
      const bool fresh = std::none_of(chosen.begin(), chosen.end(), [&](size_t taken) {
        return std::abs(Correlation(pool[taken], pool[i], count)) >= limit;
      });
      if (fresh) chosen.push_back(i);
    }
    std::fprintf(stderr, "correlation below %.2f: %zu tests\n", limit, chosen.size());
  }
  return chosen;
}

int Main(int radius, int images, int pool_size) {
  Random random(2);
  const std::vector<cv::Point> points = PatchPoints(radius);
  const TrainingSet set = MakeTrainingSet(points, images, random);
  std::fprintf(stderr, "%zu keypoints seen twice\n", set.size());
  std::vector<Test> pool;
  for (int i = 0; i < pool_size; ++i) {
    Test test;
    test.first = static_cast<int>(random.Index(static_cast<uint32_t>(points.size())));
    test.second = static_cast<int>(random.Index(static_cast<uint32_t>(points.size())));
    if (test.first == test.second) continue;
    Evaluate(set, &test);
    const double mean = static_cast<double>(test.ones) / static_cast<double>(set.size());
    if (std::abs(mean - 0.5) > kMeanTolerance) continue;
    pool.push_back(std::move(test));
  }
  std::stable_sort(pool.begin(), pool.end(), [](const Test& a, const Test& b) { return a.cost < b.cost; });
  std::printf("// Made by tools/learn_orb_tests.cc. {x, y} of the first point, {x, y} of the second, px.\n");
  for (const size_t i : Choose(pool, set.size())) {
    const cv::Point a = points[pool[i].first], b = points[pool[i].second];
    std::printf("{{%d, %d, %d, %d}},\n", a.x, a.y, b.x, b.y);
  }
  return 0;
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  const auto argument = [&](int i, int fallback) { return argc > i ? std::atoi(argv[i]) : fallback; };
  return dynamic_slam::Main(argument(1, 15), argument(2, 100), argument(3, 60000));
}
