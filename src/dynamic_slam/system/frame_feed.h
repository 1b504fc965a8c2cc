#pragma once

#include <memory>
#include <optional>

#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// How the images of a source come to tracking.
class FrameFeed {
 public:
  virtual ~FrameFeed() = default;

  // The next image, or nothing at the end. Throws what the source throws.
  virtual std::optional<SourceImage> Next() = 0;

  // Images that came too fast to be taken.
  virtual size_t DroppedCount() const = 0;
};

// One after the other, as fast as they are taken. The source must outlive the feed, and is the feed's alone.
std::unique_ptr<FrameFeed> MakeDirectFeed(FrameSource* source);

// At the pace of their time stamps, or of the camera that they come from, read in a thread of its own. A few
// wait for a tracker that is late for a moment; of more, the oldest is dropped.
std::unique_ptr<FrameFeed> MakeRealtimeFeed(FrameSource* source);

}  // namespace dynamic_slam
