#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/io/image_preparer.h"

namespace dynamic_slam {

// Those whose class the program's own prior calls dynamic.
std::vector<BoxRecord> MoversOf(std::vector<BoxRecord> records);

// The file of the true boxes, which not every sequence has.
std::filesystem::path TrueBoxes(const std::filesystem::path& sequence);

// The true boxes, in the images of the stamps (s) as they are prepared, of movers: people and cars, parked
// ones too, whose class the program's own prior calls dynamic. Those lower than 30 px there count as hidden,
// as a small network cannot know them (detection_metrics.h: neither found nor missed). Empty where the folder
// has no boxes.csv.
std::vector<BoxRecord> TrueMovers(const std::filesystem::path& sequence, std::span<const double> stamps_s,
                                  const ImagePreparer& preparer);

}  // namespace dynamic_slam
