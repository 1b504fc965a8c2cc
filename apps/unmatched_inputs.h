#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/io/frame_source.h"
#include "mask_folder.h"
#include "run_console.h"

namespace dynamic_slam {

// Boxes and masks of another program that belong to no image of the run are of no use, and nothing else would
// say so: names and stamps are easily those of another sequence, or in another unit.
class UnmatchedInputs {
 public:
  // detector: as --detector names it. masks: of --masks, if there are any. Throws InputError.
  UnmatchedInputs(const std::string& detector, std::optional<MaskFolder> masks, const RunConsole& console);

  // To be called after each image: warns once, after so many that it cannot be chance.
  void Watch(const SourceImage& image);

  // To be called when the run has ended: a short one was not warned of yet.
  void Finish();

 private:
  void Warn() const;

  const RunConsole& console_;
  std::string box_file_;
  std::vector<double> box_stamps_s_;  // in order; empty: nothing to watch
  std::optional<MaskFolder> masks_;
  size_t images_ = 0, with_boxes_ = 0, with_mask_ = 0;
  double first_stamp_s_ = 0, last_stamp_s_ = 0;
  std::string expected_mask_;  // of the first image
  bool is_done_ = false;
};

}  // namespace dynamic_slam
