#pragma once

#include <string>
#include <string_view>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// How a network wants its image.
struct NetworkInputOptions {
  static constexpr std::string_view kChannels[] = {"rgb", "bgr"};
  static constexpr std::string_view kResizes[] = {"plain", "letterbox"};

  int width = 0;
  int height = 0;
  std::string channels = "rgb";
  double mean_red = 0;
  double mean_green = 0;
  double mean_blue = 0;
  double scale = 1;
  std::string resize = "plain";
  int pad = 114;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("width", self.width, OptionField{"px", 8, 4096, "Size of the network's input."});
    visit("height", self.height, OptionField{"px", 8, 4096, ""});
    visit("channels", self.channels, OptionField{"", 0, 0, "Order of the colours.", kChannels});
    visit("mean_red", self.mean_red,
          OptionField{"", 0, 255, "Taken off each pixel value, which is 0 to 255, before scaling."});
    visit("mean_green", self.mean_green, OptionField{"", 0, 255, ""});
    visit("mean_blue", self.mean_blue, OptionField{"", 0, 255, ""});
    visit("scale", self.scale, OptionField{"", 1e-6, 1e3, "What it is multiplied with then."});
    visit("resize", self.resize,
          OptionField{"", 0, 0,
                      "plain: stretched to the input. letterbox: keeps its proportions, at the top left, the "
                      "rest filled with pad.",
                      kResizes});
    visit("pad", self.pad, OptionField{"", 0, 255, "Pixel value of what a letterbox leaves free."});
  }
};

// From px of the network's input to px of the image.
struct ImageFromInput {
  double scale_x = 1, scale_y = 1;

  Box operator*(const Box& box) const {
    return {scale_x * box.x, scale_y * box.y, scale_x * box.width, scale_y * box.height};
  }
};

// The network's input for an image, CV_8UC1 or CV_8UC3 (BGR): 1 x 3 x height x width floats.
struct NetworkInput {
  cv::Mat blob;
  ImageFromInput image_from_input;
};
NetworkInput MakeNetworkInput(const cv::Mat& image, const NetworkInputOptions& options);

}  // namespace dynamic_slam
