#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <unordered_map>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/features/image_pyramid.h"
#include "dynamic_slam/features/patch_alignment.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/image_archive.h"

namespace dynamic_slam {

// Finds to a fraction of a pixel where images show landmarks: where they look as in one keyframe that sees
// them, the reference. Corners that are found in each image for itself are off by half a pixel and more. The
// images are kept in a file.
class SightingAligner {
 public:
  // Of the frames of each part of the map, by stamp (MotionsAlong).
  using Motions = std::map<PartId, std::map<double, SteadyMotion>>;

  SightingAligner(const Camera& camera, SharedMap* map);

  // grey: CV_8UC1 of the camera's size, what the frame's keypoints were found in.
  void Keep(double timestamp_s, const cv::Mat& grey) { images_.Keep(timestamp_s, grey); }

  // In the map as it is now, with poses that are right to some pixels: moves the sightings of the views, and
  // returns where keyframes see landmarks, of those that are found. motions: take what a rolling shutter read
  // to its middle row; frames that have none keep the place in the image. `should_stop` may be empty; when it
  // says so, the others stay.
  AlignedKeypoints Align(const Motions& motions, const std::function<bool()>& should_stop,
                         std::vector<FrameView>* views);
  // The same without the keyframes.
  void AlignViews(const Motions& motions, const std::function<bool()>& should_stop,
                  std::vector<FrameView>* views);

  void Clear() { images_.Clear(); }

 private:
  struct Reference {
    Observation observation;
    uint32_t octave;
    Patch patch;
  };

  bool Load(double timestamp_s);  // its image, into pyramid_
  void ChooseReferences(const Map& map);
  // Of which an image is loaded.
  struct View {
    Rigid3 cam_from_world;
    std::optional<SteadyMotion> motion;  // if it is known
  };
  View ViewOf(const Motions& motions, PartId part, double timestamp_s, const Rigid3& cam_from_world) const;
  // Moves the sighting; false, and it stays in the image, where that does not show the landmark.
  bool AlignSighting(const Map& map, const View& view, FrameView::Sighting* sighting) const;
  // Where the pixel is of what lies at a place in world, when the middle row is read.
  void Place(const View& view, const Eigen::Vector3d& x_in_world, const Eigen::Vector2f& raw_px,
             FrameView::Sighting* sighting) const;
  float SigmaOf(const Reference& reference) const;

  Camera camera_;
  SharedMap* map_;
  std::vector<float> octave_scales_;
  ImageArchive images_;
  cv::Mat grey_;
  ImagePyramid pyramid_;
  std::unordered_map<uint32_t, Reference> references_;  // by landmark id
};

}  // namespace dynamic_slam
