#include "dynamic_slam/io/fault_injection.h"

#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/checked_source.h"

namespace dynamic_slam {
namespace {

// What a camera that moves by `length_px` in a direction during the exposure sees.
cv::Mat BlurAlong(const cv::Mat& image, double length_px, double angle_rad) {
  const int half = static_cast<int>(std::ceil(length_px / 2));
  cv::Mat1f kernel = cv::Mat1f::zeros(2 * half + 1, 2 * half + 1);
  const double x = 0.5 * length_px * std::cos(angle_rad), y = 0.5 * length_px * std::sin(angle_rad);
  constexpr int kShift = 4;  // bits of a fraction of a pixel
  const auto at = [half](double dx, double dy) {
    return cv::Point(cvRound((half + dx) * (1 << kShift)), cvRound((half + dy) * (1 << kShift)));
  };
  cv::line(kernel, at(-x, -y), at(x, y), 1.0, 1, cv::LINE_8, kShift);
  cv::Mat blurred;
  cv::filter2D(image, blurred, -1, kernel / cv::sum(kernel)[0], {-1, -1}, 0, cv::BORDER_REPLICATE);
  return blurred;
}

class FaultySource : public CheckedSource {
 public:
  FaultySource(std::unique_ptr<FrameSource> source, const FaultOptions& options)
      : CheckedSource(source->Layout(), false), source_(std::move(source)), options_(options) {
    ReadFirst(Layout());
  }

  size_t FrameCount() const override { return source_->FrameCount(); }
  bool IsLive() const override { return source_->IsLive(); }
  std::string EndReason() const override { return source_->EndReason(); }
  std::optional<Camera> OwnCamera() const override { return source_->OwnCamera(); }

 private:
  struct Arrival {
    SourceImage image;
    std::string refusal;  // empty when there is nothing to say against it
  };

  bool ReadNext(SourceImage* image, std::string* reason) override {
    while (arrivals_.empty()) {
      if (!ReadMore()) return false;
    }
    *image = std::move(arrivals_.front().image);
    *reason = std::move(arrivals_.front().refusal);
    arrivals_.pop_front();
    return true;
  }

  // The next frame of the source, with its faults, and what the source skipped before it.
  bool ReadMore() {
    std::optional<SourceImage> image = source_->Next();
    for (; problems_seen_ < source_->Problems().size(); ++problems_seen_) {
      const SourceProblem& problem = source_->Problems()[problems_seen_];
      arrivals_.push_back({{0, {}, problem.name}, problem.reason});
    }
    if (image.has_value()) {
      AddWithFaults(std::move(*image));
    } else if (late_.has_value()) {
      arrivals_.push_back({*std::exchange(late_, std::nullopt), ""});
    }
    return !arrivals_.empty() || image.has_value();
  }

  void AddWithFaults(SourceImage image) {
    // Each frame has random numbers of its own, always as many: a fault more leaves the others as they are.
    Random random(Random(options_.seed).Next() ^ (0xd1342543de82ef95ULL * frames_++));
    double chances[8], how[2];
    for (double& chance : chances) chance = random.Uniform();
    for (double& value : how) value = random.Uniform();
    if (!start_s_.has_value()) start_s_ = image.timestamp_s;
    const double time_s = image.timestamp_s - *start_s_, last_stamp_s = last_stamp_s_;
    last_stamp_s_ = image.timestamp_s;
    const bool is_open = frames_ > 1 && time_s >= options_.from && (options_.to == 0 || time_s < options_.to);
    const auto happens = [&](int fault, double share) { return is_open && chances[fault] < share; };
    const cv::Mat shown = last_shown_;

    std::string refusal;
    if (happens(0, options_.drop)) refusal = "it was dropped (fault injection)";
    if (happens(1, options_.black)) image.image = cv::Mat::zeros(image.image.size(), image.image.type());
    if (happens(2, options_.blur)) {
      image.image = BlurAlong(image.image, 5 + 20 * how[0], std::numbers::pi * how[1]);
    }
    if (happens(3, options_.exposure)) {
      cv::Mat exposed;
      image.image.convertTo(exposed, -1, std::pow(4.0, 2 * how[0] - 1));
      image.image = exposed;
    }
    if (happens(4, options_.freeze)) image.image = shown;
    last_shown_ = image.image;
    if (happens(5, options_.resize)) {
      cv::Mat half;
      cv::resize(image.image, half, {}, 0.5, 0.5, cv::INTER_AREA);
      image.image = half;
    }
    if (happens(6, options_.stamp)) {
      const double stamps_s[] = {std::numeric_limits<double>::quiet_NaN(), image.timestamp_s - 1,
                                 last_stamp_s};
      image.timestamp_s = stamps_s[static_cast<int>(3 * how[0])];
    }
    std::optional<SourceImage> late = std::exchange(late_, std::nullopt);
    if (happens(7, options_.swap) && refusal.empty()) {
      late_ = std::move(image);
    } else {
      arrivals_.push_back({std::move(image), std::move(refusal)});
    }
    if (late.has_value()) arrivals_.push_back({std::move(*late), ""});
  }

  std::unique_ptr<FrameSource> source_;
  FaultOptions options_;
  std::deque<Arrival> arrivals_;
  std::optional<SourceImage> late_;  // comes after the next one
  size_t problems_seen_ = 0;
  uint64_t frames_ = 0;
  std::optional<double> start_s_;
  double last_stamp_s_ = 0;
  cv::Mat last_shown_;
};

}  // namespace

FaultOptions ParseFaults(const std::string& text, const std::string& what) {
  FaultOptions options;
  std::vector<std::string> assignments;
  for (const std::string_view assignment : SplitColumns(text, ",")) assignments.emplace_back(assignment);
  ApplySetEntries(CollectOptions(options), assignments, what);
  return options;
}

std::unique_ptr<FrameSource> InjectFaults(std::unique_ptr<FrameSource> source, const FaultOptions& options) {
  return std::make_unique<FaultySource>(std::move(source), options);
}

}  // namespace dynamic_slam
