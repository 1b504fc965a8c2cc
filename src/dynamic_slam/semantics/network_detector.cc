#include "dynamic_slam/semantics/network_detector.h"

#include <algorithm>
#include <utility>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/semantics/decoder.h"
#include "dynamic_slam/semantics/network_files.h"
#include "dynamic_slam/semantics/sanitise.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

cv::dnn::Net ReadNetwork(const std::string& framework, const fs::path& model, const fs::path& config) {
  if (framework == "caffe") return cv::dnn::readNetFromCaffe(config.string(), model.string());
  if (framework == "darknet") return cv::dnn::readNetFromDarknet(config.string(), model.string());
  if (framework == "tensorflow") return cv::dnn::readNetFromTensorflow(model.string(), config.string());
  return cv::dnn::readNetFromONNX(model.string());
}

std::vector<Anchor> ReadAnchors(const fs::path& file) {
  std::vector<Anchor> anchors;
  for (const TextLine& line : ReadDataLines(file)) {
    std::vector<double> numbers;
    for (const std::string_view column : SplitColumns(line.text, ",")) {
      if (const std::optional<double> number = ParseDouble(column)) numbers.push_back(*number);
    }
    if (numbers.size() != 4) {
      throw InputError(fmt::format("{}:{}", file.string(), line.number),
                       "four numbers are wanted: center y, center x, height, width",
                       "Get the network's own file of anchors.");
    }
    anchors.push_back({numbers[0], numbers[1], numbers[2], numbers[3]});
  }
  return anchors;
}

// OpenCV logs what it then throws; our error says it once.
class QuietOpenCv {
 public:
  QuietOpenCv() : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(level_); }
  QuietOpenCv(const QuietOpenCv&) = delete;
  QuietOpenCv& operator=(const QuietOpenCv&) = delete;

 private:
  cv::utils::logging::LogLevel level_;
};

class NetworkDetector : public Detector {
 public:
  NetworkDetector(const DetectorFile& file, const std::vector<fs::path>& folders)
      : Detector(file.name, file.class_names), options_(file.options) {
    const fs::path model = RequireNetworkFile(file, "model", folders);
    const fs::path config = RequireNetworkFile(file, "config", folders);
    const fs::path anchors = RequireNetworkFile(file, "anchors", folders);
    std::string hint;
    for (const NetworkFile& network_file : FindNetworkFiles(file, folders)) {
      const std::string wrong = network_file.WrongSha256();
      if (wrong.empty()) continue;
      hint = fmt::format("{} is not the file expected: its SHA-256 is {}, not {}",
                         network_file.found->string(), wrong, network_file.wanted.sha256);
      AddWarning(hint);
    }
    if (!hint.empty()) hint = " " + hint + ".";
    if (!options_.origin.empty()) hint += fmt::format(" Its files are from {}.", options_.origin);

    decoder_ = {cv::Size(options_.input.width, options_.input.height),
                static_cast<int>(file.class_names.size()), options_.output.background_column,
                options_.score_threshold};
    if (!anchors.empty()) anchors_ = ReadAnchors(anchors);
    const std::string files = config.empty() ? model.string() : model.string() + ", " + config.string();
    const QuietOpenCv quiet;
    try {
      network_ = ReadNetwork(options_.framework, model, config);
      network_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      output_names_ = network_.getUnconnectedOutLayersNames();
    } catch (const std::exception& error) {
      throw InputError(
          files, fmt::format("cannot be read as a network of {}: {}", options_.framework, Reason(error)),
          "Check that the file is whole." + hint);
    }
    if (options_.output.decoding == "ssd_raw")
      output_names_ = {options_.output.boxes, options_.output.scores};
    // The number of threads changes neither results nor, with 1, what is left for the rest of the program.
    cv::setNumThreads(options_.threads == 0 ? -1 : options_.threads);
    try {
      Find(cv::Mat(decoder_.input_px, CV_8UC3, cv::Scalar::all(128)), FrameId(), 0);
    } catch (const InputError& error) {
      throw InputError(file.file.string(), error.what(), "Network: " + files + "." + hint);
    } catch (const std::exception& error) {
      throw InputError(files, fmt::format("cannot be run: {}", Reason(error)),
                       fmt::format("Check input and output in {}.{}", file.file.string(), hint));
    }
  }

 private:
  static std::string Reason(const std::exception& error) {
    const auto* from_opencv = dynamic_cast<const cv::Exception*>(&error);
    return std::string(Trim(from_opencv != nullptr ? from_opencv->err : error.what()));
  }

  std::vector<Detection> Find(const cv::Mat& image, FrameId, double) override {
    DS_TRACE("detector/network");
    const NetworkInput input = MakeNetworkInput(image, options_.input);
    network_.setInput(input.blob);
    std::vector<cv::Mat> outputs;
    network_.forward(outputs, output_names_);
    std::vector<Detection> detections = Decode(outputs);
    std::erase_if(detections, [this](const Detection& d) {
      return class_names()[static_cast<size_t>(d.class_id)] == "-";
    });
    for (Detection& detection : detections) detection.box = input.image_from_input * detection.box;
    return SuppressNonMaxima(std::move(detections), options_.nms_threshold);
  }

  // In px of the network's input.
  std::vector<Detection> Decode(const std::vector<cv::Mat>& outputs) const {
    const NetworkOutputOptions& output = options_.output;
    if (output.decoding == "ssd_raw") {
      return DecodeSsd(outputs[0], outputs[1], anchors_, {output.variance_center, output.variance_size},
                       decoder_);
    }
    std::vector<Detection> all;
    for (const cv::Mat& one : outputs) {
      const std::vector<Detection> detections = output.decoding == "yolox" ? DecodeYolox(one, decoder_)
                                                : output.decoding == "yolo_region"
                                                    ? DecodeRegion(one, decoder_)
                                                    : DecodeDetectionOutput(one, decoder_);
      all.insert(all.end(), detections.begin(), detections.end());
    }
    return all;
  }

  DetectorOptions options_;
  DecoderOptions decoder_;
  std::vector<Anchor> anchors_;
  cv::dnn::Net network_;
  std::vector<std::string> output_names_;
};

}  // namespace

std::unique_ptr<Detector> MakeNetworkDetector(const DetectorFile& file,
                                              const std::vector<fs::path>& folders) {
  return std::make_unique<NetworkDetector>(file, folders);
}

}  // namespace dynamic_slam
