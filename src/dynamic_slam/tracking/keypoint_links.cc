#include "dynamic_slam/tracking/keypoint_links.h"

#include "dynamic_slam/base/percentile.h"

namespace dynamic_slam {

double AwayFromLinks_px(const Camera& camera, const Map& map, const Keyframe& keyframe,
                        const KeypointLinks& links, const Rigid3& cam_from_world) {
  std::vector<double> away_px;
  for (const auto& [keypoint, landmark] : links) {
    const Eigen::Vector3d x = cam_from_world * map.landmarks().At(landmark).position();
    const Keypoint& seen = keyframe.keypoint(keypoint);
    away_px.push_back(x.z() > 0 ? (camera.Project(x) - Eigen::Vector2d(seen.x, seen.y)).norm()
                                : camera.width);
  }
  return away_px.empty() ? camera.width : Percentile(0.5, &away_px);
}

}  // namespace dynamic_slam
