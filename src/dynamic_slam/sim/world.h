#pragma once

#include <string>
#include <vector>

#include "dynamic_slam/sim/mesh_renderer.h"
#include "dynamic_slam/sim/planar_path.h"
#include "dynamic_slam/sim/scene_options.h"

namespace dynamic_slam {

// Something that truth knows of; its index is the object of its meshes.
struct SceneObject {
  std::string class_name;  // as COCO has it
  bool moves = false;
};

// What a scene is built of before anybody moves. World frame: z up, the floor at z = 0.
struct World {
  std::vector<MeshInstance> statics;
  std::vector<SceneObject> objects;
  Lighting lighting;

  Eigen::Vector3d camera_centre{0, 0, 1.4};  // about which a hand-held camera sways
  Eigen::Vector3d camera_target{1, 0, 1.2};  // at which it looks
  std::vector<PlanarPath> camera_path;       // the loop that motion `path` follows; none or one
  std::vector<PlanarPath> walks;             // where people can walk
  std::vector<PlanarPath> lanes;             // where cars drive; the first is the camera's own
  double car_gap_m = 14;  // ahead of and behind the camera that stays free of cars in its lane

  void Add(Mesh mesh, const Rigid3& world_from_mesh, int object = kNoObject, float max_distance_m = 1e9) {
    statics.emplace_back(std::make_shared<Mesh>(std::move(mesh)), world_from_mesh, object, max_distance_m);
  }
  int AddObject(const std::string& class_name, bool moves) {
    objects.push_back({class_name, moves});
    return static_cast<int>(objects.size()) - 1;
  }
};

// The worlds, by seed and size. `camera_height_m`: of a camera in a hand.
World MakeOffice(const SceneOptions& options);
World MakeCorridor(const SceneOptions& options);
World MakeStreet(const SceneOptions& options);

}  // namespace dynamic_slam
