#pragma once

#include <filesystem>
#include <functional>

#include "dynamic_slam/sim/simulation.h"

namespace dynamic_slam {

// Writes a simulation's frames, but the dropped ones, in the layout of TUM RGB-D: rgb/*.jpg, rgb.txt,
// groundtruth.txt with the pose of every frame, and beside it camera.yaml, scene.yaml with every option,
// boxes.csv
// (`timestamp,actor,class,x,y,w,h,visible,moving`), masks/*.png, 255 where something moves, and,
// `with_depth`, depth/*.png of 16 bits with depth.txt, which states the unit. Frames are rendered in
// parallel; the bytes do not depend on it. `on_frame` is told how many frames are done. rgb.txt, which makes
// the folder a sequence, comes last. Throws InputError when something cannot be written.
void WriteSimulation(const Simulation& simulation, const std::filesystem::path& folder, bool with_depth,
                     const std::function<void(int)>& on_frame = {});

}  // namespace dynamic_slam
