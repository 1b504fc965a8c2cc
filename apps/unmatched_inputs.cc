#include "unmatched_inputs.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include <fmt/core.h>

#include "dynamic_slam/io/box_file.h"

namespace dynamic_slam {
namespace {

constexpr size_t kImages = 100;           // until a warning
constexpr double kMaxDifferenceS = 0.01;  // as MakeReplayDetector at most
constexpr std::string_view kBoxesPrefix = "boxes:";

}  // namespace

UnmatchedInputs::UnmatchedInputs(const std::string& detector, std::optional<MaskFolder> masks,
                                 const RunConsole& console)
    : console_(console), masks_(std::move(masks)) {
  if (!detector.starts_with(kBoxesPrefix)) return;
  box_file_ = detector.substr(kBoxesPrefix.size());
  for (const BoxRecord& record : ReadBoxFile(box_file_)) box_stamps_s_.push_back(record.timestamp_s);
  std::sort(box_stamps_s_.begin(), box_stamps_s_.end());
}

void UnmatchedInputs::Watch(const SourceImage& image) {
  if (is_done_) return;
  if (images_++ == 0) first_stamp_s_ = image.timestamp_s;
  last_stamp_s_ = image.timestamp_s;
  const auto next =
      std::lower_bound(box_stamps_s_.begin(), box_stamps_s_.end(), image.timestamp_s - kMaxDifferenceS);
  with_boxes_ += next != box_stamps_s_.end() && *next <= image.timestamp_s + kMaxDifferenceS;
  if (masks_.has_value()) {
    const std::filesystem::path mask = masks_->PathOf(image);
    with_mask_ += std::filesystem::exists(mask);
    if (expected_mask_.empty()) expected_mask_ = mask.filename().string();
  }
  if (images_ >= kImages) Finish();
}

void UnmatchedInputs::Finish() {
  if (!std::exchange(is_done_, true) && images_ > 0) Warn();
}

void UnmatchedInputs::Warn() const {
  if (!box_stamps_s_.empty() && with_boxes_ == 0) {
    console_.Say(fmt::format(
        "warning: {} has boxes for none of {} images: their stamps are {:.3f} to {:.3f} s, those of the "
        "boxes "
        "{:.3f} to {:.3f} s",
        box_file_, images_, first_stamp_s_, last_stamp_s_, box_stamps_s_.front(), box_stamps_s_.back()));
  }
  if (masks_.has_value() && with_mask_ == 0) {
    std::string there;
    for (const auto& entry : std::filesystem::directory_iterator(masks_->folder())) {
      const std::string name = entry.path().filename().string();
      if (there.empty() || name < there) there = name;
    }
    console_.Say(fmt::format("warning: --masks {} has a mask for none of {} images: {} is not there{}",
                             masks_->folder().string(), images_, expected_mask_,
                             there.empty() ? ", nothing is" : ", but for instance " + there));
  }
}

}  // namespace dynamic_slam
