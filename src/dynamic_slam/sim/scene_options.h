#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "dynamic_slam/base/option_field.h"

namespace dynamic_slam {

inline constexpr std::string_view kWorlds[] = {"office", "street", "corridor"};
inline constexpr std::string_view kMotions[] = {"hand_held", "xyz", "rpy", "halfsphere", "static", "path"};

struct WorldOptions {
  std::string kind = "office";
  double length_m = 6.5;
  double width_m = 6.0;
  double richness = 1.0;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("kind", self.kind, OptionField{"", 0, 0, "What is built.", kWorlds});
    visit("length_m", self.length_m,
          OptionField{"m", 4, 1000, "Of the room, or of the loop's centre line, ahead of the camera."});
    visit("width_m", self.width_m, OptionField{"m", 4, 1000, "The same to the left."});
    visit("richness", self.richness, OptionField{"", 0, 3, "Contrast and number of marks on walls."});
  }
};

struct PeopleOptions {
  int count = 2;
  bool near_camera = false;
  double nearest_m = 1.6;
  int per_row = 4;
  bool towards_camera = false;
  double speed_m_per_s = 1.1;
  double richness = 1.0;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("count", self.count, OptionField{"", 0, 200, "People who walk."});
    visit("near_camera", self.near_camera,
          OptionField{"", 0, 0, "They walk to and fro right before the camera, in rows, always in view."});
    visit("nearest_m", self.nearest_m, OptionField{"m", 0.5, 100, "How far away the first row is."});
    visit("per_row", self.per_row, OptionField{"", 1, 200, "People in a row at most."});
    visit("towards_camera", self.towards_camera,
          OptionField{"", 0, 0, "They come towards the camera and go away again; before near_camera."});
    visit("speed_m_per_s", self.speed_m_per_s, OptionField{"m/s", 0, 3, "Mean speed; each has its own."});
    visit("richness", self.richness, OptionField{"", 0, 3, "Contrast of folds and grain of their clothes."});
  }
};

struct CarOptions {
  int moving = 6;
  double parked_share = 0.5;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("moving", self.moving, OptionField{"", 0, 200, "Cars that drive, in a street."});
    visit("parked_share", self.parked_share,
          OptionField{"", 0, 1, "Share of the places beside the road that are taken."});
  }
};

struct CameraOptions {
  std::string model;
  std::string motion = "hand_held";
  double fps = 0;
  double height_m = 1.4;
  double amplitude = 1;
  double speed_m_per_s = 1.2;
  double stop_at_s = 0;
  double stop_s = 0;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("model", self.model,
          OptionField{"", 0, 0, "Name or file of a camera; empty: 640 x 480 px, 30 Hz, no distortion."});
    visit("motion", self.motion,
          OptionField{"", 0, 0, "As in the sequences of TUM; path: along the loop.", kMotions});
    visit("fps", self.fps, OptionField{"Hz", 0, 1000, "Frames per second; 0: the camera's."});
    visit("height_m", self.height_m, OptionField{"m", 0.2, 20, "Above the floor."});
    visit("amplitude", self.amplitude, OptionField{"", 0, 3, "Factor on how far it sways and turns."});
    visit("speed_m_per_s", self.speed_m_per_s, OptionField{"m/s", 0, 50, "Along the path."});
    visit("stop_at_s", self.stop_at_s, OptionField{"s", 0, 1e6, "When it stops for a while."});
    visit("stop_s", self.stop_s, OptionField{"s", 0, 1e6, "For how long; 0: never."});
  }
};

struct EffectOptions {
  double noise_grey = 1.5;
  double exposure_ms = 8;
  double exposure_change = 0.1;
  double vignette = 0.15;
  double drop_share = 0;
  int jpeg_quality = 95;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("noise_grey", self.noise_grey,
          OptionField{"", 0, 50, "Standard deviation of a pixel's noise, grey levels."});
    visit("exposure_ms", self.exposure_ms,
          OptionField{"ms", 0, 1000, "What moves meanwhile is blurred; 0: nothing is."});
    visit("exposure_change", self.exposure_change,
          OptionField{"", 0, 0.9, "How far the brightness comes and goes, as a share."});
    visit("vignette", self.vignette, OptionField{"", 0, 1, "How much darker the corners are, as a share."});
    visit("drop_share", self.drop_share, OptionField{"", 0, 0.9, "Share of the frames that are lost."});
    visit("jpeg_quality", self.jpeg_quality, OptionField{"", 1, 100, "Of the images that are written."});
  }
};

// A scene file: all there is to say of a simulated sequence. The same options give the same bytes.
struct SceneOptions {
  uint64_t seed = 1;
  int frames = 300;
  WorldOptions world;
  PeopleOptions people;
  CarOptions cars;
  CameraOptions camera;
  EffectOptions effects;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("seed", self.seed, OptionField{"", 0, 0, "Of everything: another seed is another scene."});
    visit("frames", self.frames, OptionField{"", 1, 1e6, "Images."});
    visit("world", self.world);
    visit("people", self.people);
    visit("cars", self.cars);
    visit("camera", self.camera);
    visit("effects", self.effects);
  }
};

}  // namespace dynamic_slam
