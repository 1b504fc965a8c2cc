#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace dynamic_slam {

// One image that a sequence announces.
struct SourceEntry {
  double timestamp_s = 0;
  std::filesystem::path file;
  std::string name;     // for messages
  std::string problem;  // why it cannot be used, if that is known already
};

// What a folder says about its images, before any of them is read.
struct SourceListing {
  std::string layout;            // see FrameSource::Layout
  std::filesystem::path folder;  // where camera.yaml may be
  std::filesystem::path calib;   // calib.txt or sensor.yaml; may not exist
  std::vector<SourceEntry> entries;
};

// Recognises the folder's layout and lists its images in order, with the problems that can be told by then:
// lines that cannot be read, stamps far ahead of all that follow. Throws InputError as OpenFrameSource does.
// fps: of a folder of images.
SourceListing ListSource(const std::filesystem::path& folder, double fps);

// Orders runs of digits by their value: "img2" before "img10".
bool NaturalLess(std::string_view a, std::string_view b);

}  // namespace dynamic_slam
