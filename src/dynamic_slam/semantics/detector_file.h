#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/network_input.h"

namespace dynamic_slam {

// One of a network's files: its name, and what a copy of it must hash to ("": not known).
struct NetworkFileOptions {
  std::string file{};
  std::string sha256{};

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("file", self.file, OptionField{"", 0, 0, "Name of the file, or its path from here."});
    visit("sha256", self.sha256, OptionField{"", 0, 0, "Its SHA-256 in hexadecimal; empty: not known."});
  }
};

// How a network's outputs are read; see decoder.h.
struct NetworkOutputOptions {
  static constexpr std::string_view kDecodings[] = {"ssd_detection_output", "ssd_raw", "yolo_region",
                                                    "yolox"};
  std::string decoding{};
  int background_column = -1;
  std::string boxes = "boxes";
  std::string scores = "scores";
  double variance_center = 0.1;
  double variance_size = 0.2;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("decoding", self.decoding,
          OptionField{"", 0, 0,
                      "ssd_detection_output: Caffe's DetectionOutput. ssd_raw: codes, scores and anchors. "
                      "yolo_region: Darknet. yolox: raw grids.",
                      kDecodings});
    visit("background_column", self.background_column,
          OptionField{"", -1, 10000, "The column or label of the scores that is no class; -1: none."});
    visit("boxes", self.boxes, OptionField{"", 0, 0, "ssd_raw: name of the output with the codes."});
    visit("scores", self.scores, OptionField{"", 0, 0, "ssd_raw: name of the output with the scores."});
    visit("variance_center", self.variance_center,
          OptionField{"", 1e-6, 1e3, "ssd_raw: what the codes of a center are multiplied with."});
    visit("variance_size", self.variance_size,
          OptionField{"", 1e-6, 1e3, "ssd_raw: what the codes of a size are multiplied with."});
  }
};

// What a detector file (YAML, config/detectors) says of a network.
struct DetectorOptions {
  static constexpr std::string_view kFrameworks[] = {"caffe", "onnx", "darknet", "tensorflow"};

  std::string about{};
  std::string origin{};
  std::string licence{};
  std::string framework{};
  NetworkFileOptions model{}, config{}, anchors{};
  NetworkInputOptions input{};
  NetworkOutputOptions output{};
  std::string classes{};
  double score_threshold = 0.4;
  double nms_threshold = 0.45;
  int threads = 1;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("about", self.about, OptionField{"", 0, 0, "What it is, in a few words."});
    visit("origin", self.origin, OptionField{"", 0, 0, "Where to get its files."});
    visit("licence", self.licence, OptionField{"", 0, 0, "Under which terms."});
    visit("framework", self.framework, OptionField{"", 0, 0, "What the files are for.", kFrameworks});
    visit("model", self.model);
    visit("config", self.config);    // Caffe's prototxt, Darknet's cfg, TensorFlow's pbtxt
    visit("anchors", self.anchors);  // of ssd_raw: center y, center x, height, width in a line each
    visit("input", self.input);
    visit("output", self.output);
    visit("classes", self.classes,
          OptionField{"", 0, 0,
                      "The class names: 'person, car', or a file with one in a line; - is a class without "
                      "a name, which is not reported."});
    visit("score_threshold", self.score_threshold, OptionField{"", 0, 1, "Lowest score of a detection."});
    visit("nms_threshold", self.nms_threshold,
          OptionField{"", 0, 1, "Boxes of one class with a larger IoU are one object."});
    visit("threads", self.threads,
          OptionField{"", 0, 64, "Threads of OpenCV, for the whole program; 0: as many as cores."});
  }
};

struct DetectorFile {
  std::filesystem::path file;
  std::string name;  // of the file, without folder and extension
  DetectorOptions options;
  std::vector<std::string> class_names;
};

// Reads a detector file and its class names. Throws InputError with file:line for each problem.
DetectorFile ReadDetectorFile(const std::filesystem::path& file);

}  // namespace dynamic_slam
