#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// What all sources do alike: keep the first image, check size and stamp of each.
class CheckedSource : public FrameSource {
 public:
  // any_size: images of another size than the first are not skipped.
  CheckedSource(std::string layout, bool any_size) : layout_(std::move(layout)), any_size_(any_size) {}

  std::optional<SourceImage> Next() final;
  std::string Layout() const final { return layout_; }
  cv::Size ImageSize() const final { return size_; }
  const std::vector<SourceProblem>& Problems() const final { return problems_; }

 protected:
  // The next frame in order. false: there is none. *reason, empty at the call, is set when it cannot be read.
  virtual bool ReadNext(SourceImage* image, std::string* reason) = 0;

  // Reads the first image, which fixes the size. Throws InputError when there is none.
  void ReadFirst(const std::filesystem::path& path);

 private:
  std::string Refusal(const SourceImage& image);

  std::string layout_;
  bool any_size_;
  cv::Size size_;
  std::optional<SourceImage> first_;
  std::optional<double> last_stamp_s_;
  std::vector<SourceProblem> problems_;
};

}  // namespace dynamic_slam
