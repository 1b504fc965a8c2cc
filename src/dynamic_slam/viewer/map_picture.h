#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/viewer/message.h"

namespace dynamic_slam {

// A frame on the path, and which stretch of it: a new one begins where tracking was lost.
struct PathFrame {
  AnchoredPose pose;
  uint32_t stretch = 0;
};

// What is shown of a map, as values: it can be looked at without the map's lock. Positions are in the world
// of their part.
struct MapPicture {
  struct Point {
    uint32_t id, part;
    std::array<float, 3> position;
    bool operator==(const Point&) const = default;
  };
  struct Camera {
    uint32_t id, part;
    std::array<float, 7> world_from_cam;  // translation, then quaternion x y z w
    std::vector<uint32_t> neighbours;     // older keyframes that share most landmarks with it
    bool operator==(const Camera&) const = default;
  };
  struct PathPoint {
    std::array<float, 3> position;
    uint32_t stretch, part;
    bool operator==(const PathPoint&) const = default;
  };
  std::vector<Point> points;    // by id
  std::vector<Camera> cameras;  // keyframes, by id
  std::vector<PathPoint> path;  // in the order of `path` below
  uint32_t part = 0;            // where the camera was last
};

std::array<float, 7> WorldFromCam(const Rigid3& cam_from_world);

// path: frames whose part is gone are left out.
MapPicture PictureOf(const Map& map, std::span<const PathFrame> path);

// What turns a browser's picture `from` into `to`. is_whole: `from` is empty, and the browser forgets what it
// has.
Message MapMessage(const MapPicture& from, const MapPicture& to, uint32_t frame, bool is_whole);

}  // namespace dynamic_slam
