#pragma once

#include <cstdint>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/features/orb_options.h"
#include "dynamic_slam/io/image_options.h"
#include "dynamic_slam/loop/loop_options.h"
#include "dynamic_slam/mapping/mapper_options.h"
#include "dynamic_slam/system/detection_options.h"
#include "dynamic_slam/tracking/dynamic_options.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

struct SystemOptions {
  uint64_t seed = 1;
  bool final_bundle = true;
  bool backfill = true;
  bool backfill_grows_map = true;
  bool grow_twice = true;
  bool refine_poses = true;
  bool align_sightings = true;
  bool smooth_path = true;
  ImageOptions image;
  DetectionOptions detector;
  OrbOptions orb;
  TrackerOptions tracker;
  MapperOptions mapper;
  LoopOptions loop;
  DynamicOptions dynamic;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("seed", self.seed,
          OptionField{"", 0, 0, "Seed of everything random: the same seed gives the same bytes."});
    visit("final_bundle", self.final_bundle,
          OptionField{"", 0, 1, "Adjust the whole map once more when the sequence is over."});
    visit("backfill", self.backfill,
          OptionField{
              "", 0, 1,
              "Offline: frames that had no pose when their turn came get one in the finished map, where "
              "they fit it."});
    visit("backfill_grows_map", self.backfill_grows_map,
          OptionField{"", 0, 1,
                      "Before the map is finished it grows by such frames, where they show what it does not "
                      "have."});
    visit("grow_twice", self.grow_twice,
          OptionField{"", 0, 1,
                      "Where it grows, all is finished twice, with redundant keyframes culled and kept, and "
                      "the steadier path stays."});
    visit("refine_poses", self.refine_poses,
          OptionField{"", 0, 1,
                      "Offline: frames are tracked once more in the finished map, which knows more than when "
                      "their turn came; with final_bundle it is adjusted to what they see."});
    visit("align_sightings", self.align_sightings,
          OptionField{
              "", 0, 1,
              "With refine_poses: where frames see landmarks is found again in the images, to a "
              "fraction of a pixel, as one keyframe shows them. The images are kept in a temporary file, "
              "of 4 GiB at most."});
    visit("smooth_path", self.smooth_path,
          OptionField{
              "", 0, 1,
              "Offline: the path is what is most probable, as poses are noisy and what carries a camera "
              "has mass. How noisy, the poses themselves tell. Keyframes and map stay as they are."});
    visit("image", self.image);
    visit("detector", self.detector);
    visit("dynamic", self.dynamic);
    visit("orb", self.orb);
    visit("tracker", self.tracker);
    visit("mapper", self.mapper);
    visit("loop", self.loop);
  }
};

}  // namespace dynamic_slam
