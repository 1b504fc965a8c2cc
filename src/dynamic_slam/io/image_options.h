#pragma once

#include <string>

#include "dynamic_slam/base/option_field.h"

namespace dynamic_slam {

// What is done to each image before the SLAM sees it, in this order: crop, grey, eight bits, resize.
struct ImageOptions {
  int crop_left = 0;
  int crop_top = 0;
  int crop_width = 0;
  int crop_height = 0;
  int resize_width = 0;
  std::string mask{};  // path
  std::string bayer = "none";
  int white_level = 0;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    constexpr double kMaxPx = 100000;
    visit("crop_left", self.crop_left,
          OptionField{"px", 0, kMaxPx, "Columns of the raw image cut off on the left."});
    visit("crop_top", self.crop_top,
          OptionField{"px", 0, kMaxPx, "Rows of the raw image cut off at the top."});
    visit("crop_width", self.crop_width,
          OptionField{"px", 0, kMaxPx, "Columns of the raw image that are kept; 0: all to the right edge."});
    visit("crop_height", self.crop_height,
          OptionField{"px", 0, kMaxPx, "Rows of the raw image that are kept; 0: all to the bottom."});
    visit("resize_width", self.resize_width,
          OptionField{"px", 0, kMaxPx,
                      "Width to which what is kept is scaled, height in proportion; 0: as it is."});
    visit("mask", self.mask,
          OptionField{
              "", 0, 0,
              "Image of what to ignore in every frame, such as the bonnet: black is ignored, white is used. "
              "As large as the raw or as the prepared images."});
    visit("bayer", self.bayer,
          OptionField{
              "", 0, 0,
              "Colours of the top left 2 x 2 px of a raw sensor image: rggb, bggr, grbg, gbrg or none."});
    visit(
        "white_level", self.white_level,
        OptionField{"", 0, 65535,
                    "Pixel value that is white, such as 4095 of 12 bits in 16; 0: the largest of the type."});
  }
};

}  // namespace dynamic_slam
