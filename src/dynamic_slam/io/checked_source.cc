#include "dynamic_slam/io/checked_source.h"

#include <cmath>
#include <utility>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

std::optional<SourceImage> CheckedSource::Next() {
  if (first_) return std::exchange(first_, std::nullopt);
  SourceImage image;
  std::string reason;
  while (ReadNext(&image, &reason)) {
    if (reason.empty()) reason = Refusal(image);
    if (reason.empty()) {
      last_stamp_s_ = image.timestamp_s;
      return image;
    }
    problems_.push_back({image.name, std::exchange(reason, "")});
  }
  return std::nullopt;
}

void CheckedSource::ReadFirst(const std::filesystem::path& path) {
  first_ = Next();
  if (first_) return;
  std::string reason = "no image of it can be read";
  if (!problems_.empty()) reason += fmt::format(" (first: {}: {})", problems_[0].name, problems_[0].reason);
  throw InputError(path.string(), reason, "Check the files, and --start and --max-frames where given.");
}

std::string CheckedSource::Refusal(const SourceImage& image) {
  if (!std::isfinite(image.timestamp_s)) return fmt::format("its stamp is {}", image.timestamp_s);
  if (last_stamp_s_ && image.timestamp_s < *last_stamp_s_) {
    return fmt::format("its stamp {:.6f} goes back behind {:.6f}", image.timestamp_s, *last_stamp_s_);
  }
  if (last_stamp_s_ && image.timestamp_s == *last_stamp_s_) {
    return fmt::format("its stamp {:.6f} is a duplicate", image.timestamp_s);
  }
  if (size_.empty()) size_ = image.image.size();
  if (!any_size_ && image.image.size() != size_) {
    return fmt::format("its size is {} x {} px, that of the first image {} x {} px", image.image.cols,
                       image.image.rows, size_.width, size_.height);
  }
  return "";
}

}  // namespace dynamic_slam
