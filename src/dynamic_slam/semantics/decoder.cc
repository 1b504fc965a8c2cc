#include "dynamic_slam/semantics/decoder.h"

#include <array>
#include <cmath>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

std::string ShapeText(const cv::Mat& mat) {
  std::string text;
  for (int i = 0; i < mat.dims; ++i) text += fmt::format("{}{}", i == 0 ? "" : " x ", mat.size[i]);
  return text.empty() ? "nothing" : text;
}

[[noreturn]] void Refuse(const std::string& what, const std::string& is, const std::string& wanted) {
  throw InputError(what, fmt::format("is {}, {} is wanted", is, wanted),
                   "The detector file does not fit the network: check output.decoding, classes, "
                   "output.background_column and input.width and height.");
}

// The output as a matrix of rows of floats; an output without elements has none.
cv::Mat_<float> Rows(const cv::Mat& output, int columns, const std::string& what) {
  const std::string wanted = fmt::format("N x {} floats", columns);
  if (output.depth() != CV_32F || output.channels() != 1) Refuse(what, "not of floats", wanted);
  if (output.dims > 0 && output.total() == 0) return {};
  if (output.dims < 2 || output.size[output.dims - 1] != columns || !output.isContinuous()) {
    Refuse(what, ShapeText(output), wanted);
  }
  return output.reshape(1, static_cast<int>(output.total() / static_cast<size_t>(columns)));
}

// The class of a column or label; -1: none.
int ClassOf(int column, const DecoderOptions& options) {
  if (column == options.background_column) return -1;
  return options.background_column >= 0 && column > options.background_column ? column - 1 : column;
}

void AddFinite(const Box& box, int class_id, double score, std::vector<Detection>* detections) {
  const bool is_finite = std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
                         std::isfinite(box.height) && std::isfinite(score);
  if (is_finite) detections->push_back({box, class_id, score});
}

Box Centred(double center_x, double center_y, double width, double height) {
  return {center_x - 0.5 * width, center_y - 0.5 * height, width, height};
}

}  // namespace

std::vector<Detection> DecodeDetectionOutput(const cv::Mat& output, const DecoderOptions& options) {
  std::vector<Detection> detections;
  const cv::Mat_<float> rows = Rows(output, 7, "output of DetectionOutput");
  const double width = options.input_px.width, height = options.input_px.height;
  for (int i = 0; i < rows.rows; ++i) {
    const float* row = rows[i];
    const float label = row[1], score = row[2];
    if (!(score >= options.score_threshold)) continue;
    if (!(label >= 0 && label <= static_cast<float>(options.classes))) continue;
    const int class_id = ClassOf(static_cast<int>(label), options);
    if (class_id < 0 || class_id >= options.classes) continue;
    AddFinite({row[3] * width, row[4] * height, (row[5] - row[3]) * width, (row[6] - row[4]) * height},
              class_id, score, &detections);
  }
  return detections;
}

std::vector<Detection> DecodeSsd(const cv::Mat& boxes, const cv::Mat& scores,
                                 const std::vector<Anchor>& anchors, const SsdVariances& variances,
                                 const DecoderOptions& options) {
  const int columns = options.classes + (options.background_column >= 0 ? 1 : 0);
  const cv::Mat_<float> codes = Rows(boxes, 4, "output of boxes");
  const cv::Mat_<float> score_rows = Rows(scores, columns, "output of scores");
  const auto check = [&anchors](int rows, const char* what) {
    if (static_cast<size_t>(rows) != anchors.size()) {
      Refuse(what, fmt::format("{} rows", rows),
             fmt::format("one for each of the {} anchors", anchors.size()));
    }
  };
  check(codes.rows, "output of boxes");
  check(score_rows.rows, "output of scores");
  std::vector<Detection> detections;
  const double width = options.input_px.width, height = options.input_px.height;
  for (int i = 0; i < codes.rows; ++i) {
    const Anchor& anchor = anchors[static_cast<size_t>(i)];
    const float* code = codes[i];
    for (int column = 0; column < columns; ++column) {
      const float score = score_rows[i][column];
      const int class_id = ClassOf(column, options);
      if (class_id < 0 || !(score >= options.score_threshold)) continue;
      const double center_y = anchor.center_y + variances.center * code[0] * anchor.height;
      const double center_x = anchor.center_x + variances.center * code[1] * anchor.width;
      const double box_height = anchor.height * std::exp(variances.size * code[2]);
      const double box_width = anchor.width * std::exp(variances.size * code[3]);
      AddFinite(Centred(center_x * width, center_y * height, box_width * width, box_height * height),
                class_id, score, &detections);
    }
  }
  return detections;
}

std::vector<Detection> DecodeRegion(const cv::Mat& output, const DecoderOptions& options) {
  std::vector<Detection> detections;
  const cv::Mat_<float> rows = Rows(output, 5 + options.classes, "output of the yolo layer");
  const double width = options.input_px.width, height = options.input_px.height;
  for (int i = 0; i < rows.rows; ++i) {
    const float* row = rows[i];
    for (int class_id = 0; class_id < options.classes; ++class_id) {
      const float score = row[5 + class_id];
      if (!(score >= options.score_threshold)) continue;
      AddFinite(Centred(row[0] * width, row[1] * height, row[2] * width, row[3] * height), class_id, score,
                &detections);
    }
  }
  return detections;
}

std::vector<Detection> DecodeYolox(const cv::Mat& output, const DecoderOptions& options) {
  constexpr std::array<int, 3> kStrides = {8, 16, 32};
  const cv::Mat_<float> rows = Rows(output, 5 + options.classes, "output of YOLOX");
  int cells = 0;
  for (const int stride : kStrides) {
    cells += (options.input_px.width / stride) * (options.input_px.height / stride);
  }
  if (rows.rows != cells) {
    Refuse(
        "output of YOLOX", fmt::format("{} rows", rows.rows),
        fmt::format("{} for an input of {} x {} px", cells, options.input_px.width, options.input_px.height));
  }
  std::vector<Detection> detections;
  int i = 0;
  for (const int stride : kStrides) {
    const int grid_width = options.input_px.width / stride, grid_height = options.input_px.height / stride;
    for (int cell = 0; cell < grid_width * grid_height; ++cell, ++i) {
      const float* row = rows[i];
      for (int class_id = 0; class_id < options.classes; ++class_id) {
        const double score = static_cast<double>(row[4]) * row[5 + class_id];
        if (!(score >= options.score_threshold)) continue;
        const int x = cell % grid_width, y = cell / grid_width;
        AddFinite(Centred((row[0] + x) * stride, (row[1] + y) * stride,
                          std::exp(static_cast<double>(row[2])) * stride,
                          std::exp(static_cast<double>(row[3])) * stride),
                  class_id, score, &detections);
      }
    }
  }
  return detections;
}

}  // namespace dynamic_slam
