#include "system_binding.h"

#include <optional>
#include <string>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "dynamic_slam/dynamic_slam.h"

namespace py = pybind11;

namespace dynamic_slam {
namespace {

// A System, and the size of the images that it takes.
class PySystem {
 public:
  PySystem(const Camera& camera, const Options& options) : raw_(camera), system_(camera, options) {}

  ImageResult Process(double timestamp_s, const py::object& image, const py::object& mask) {
    const cv::Mat pixels = ToImage(image, raw_.width, raw_.height);
    cv::Mat forbidden;
    if (!mask.is_none()) forbidden = ToMask(mask, system_.camera().width, system_.camera().height);
    py::gil_scoped_release no_gil;
    return system_.Process(timestamp_s, pixels, forbidden);
  }

  System& system() { return system_; }

 private:
  Camera raw_;
  System system_;
};

RunMode ToMode(const std::string& name) {
  for (const RunMode mode : {RunMode::kOffline, RunMode::kRealtime}) {
    if (name == Name(mode)) return mode;
  }
  throw py::value_error("mode must be 'offline' or 'realtime', not '" + name + "'");
}

void BindResults(py::module_& module) {
  py::class_<ImageObject>(module, "ImageObject", "An object that is believed to be in an image.")
      .def_readonly("x", &ImageObject::x, "Left edge, px of the prepared image.")
      .def_readonly("y", &ImageObject::y, "Top edge, px.")
      .def_readonly("width", &ImageObject::width, "px")
      .def_readonly("height", &ImageObject::height, "px")
      .def_readonly("class_name", &ImageObject::class_name)
      .def_readonly("score", &ImageObject::score, "Trust in it, 0 to 1.")
      .def_readonly("track_id", &ImageObject::track_id, "The same object in other images.")
      .def_readonly("is_detected", &ImageObject::is_detected,
                    "By the detector in this image; else carried on from earlier ones.")
      .def_readonly("is_dynamic", &ImageObject::is_dynamic, "Of a kind that moves.")
      .def("__repr__", [](const ImageObject& object) {
        return "<ImageObject " + object.class_name + " " + std::to_string(object.track_id) + ">";
      });
  py::class_<ImageResult>(module, "ImageResult", "What became of one image.")
      .def_readonly("timestamp", &ImageResult::timestamp_s, "s")
      .def_property_readonly(
          "state", [](const ImageResult& result) { return Name(result.state); },
          "'initialising', 'tracking' or 'lost'.")
      .def_readonly("reason", &ImageResult::reason,
                    "Why there is no pose, or that the map was begun; else ''.")
      .def_property_readonly(
          "world_from_cam",
          [](const ImageResult& result) -> py::object {
            return result.world_from_cam ? py::object(ToArray(*result.world_from_cam)) : py::none();
          },
          "Array of shape (4, 4), or None without a pose. Finish, loops and later images may still move it.")
      .def_readonly("keypoints", &ImageResult::keypoints)
      .def_readonly("inliers", &ImageResult::inliers, "Landmarks that fit the pose.")
      .def_readonly("is_keyframe", &ImageResult::is_keyframe)
      .def_readonly("objects", &ImageResult::objects, "List of ImageObject.")
      .def_readonly("tracking_ms", &ImageResult::tracking_ms, "From the image in memory to its pose.")
      .def("__repr__", [](const ImageResult& result) {
        return "<ImageResult " + std::to_string(result.timestamp_s) + " s: " + Name(result.state) +
               (result.reason.empty() ? "" : " (" + result.reason + ")") + ">";
      });
}

}  // namespace

void BindSystem(py::module_& module) {
  BindResults(module);
  const Options defaults;
  py::class_<PySystem>(
      module, "System",
      "Dynamic-SLAM: from the images of one camera to its path and a map of what stands still.\n\n"
      "Calls come from one thread at a time; others run meanwhile, as process() and finish() release the "
      "GIL.")
      .def(py::init([](const Camera& camera, const std::string& config, const std::vector<std::string>& set,
                       const std::string& mode, const std::string& detector, const std::string& models,
                       const std::string& map, bool localise_only) {
             const Options options{config, set, ToMode(mode), detector, models, map, localise_only};
             py::gil_scoped_release no_gil;
             return std::make_unique<PySystem>(camera, options);
           }),
           py::arg("camera"), py::kw_only(), py::arg("config") = defaults.config,
           py::arg("set") = defaults.set, py::arg("mode") = Name(defaults.mode),
           py::arg("detector") = defaults.detector, py::arg("models") = defaults.models,
           py::arg("map") = defaults.map, py::arg("localise_only") = defaults.localise_only,
           "camera: of the images. config: YAML file with options, or the name of a profile. set: list of\n"
           "'key=value'. mode: 'offline' or 'realtime'. detector: 'none', 'hog', 'boxes:FILE.csv', a "
           "detector file\n"
           "or the name of one. models: folder with network files. map: file of an earlier run's map, in "
           "which the\n"
           "camera is looked for first; with localise_only it stays as it is.")
      .def("process", &PySystem::Process, py::arg("timestamp"), py::arg("image"),
           py::arg("mask") = py::none(),
           "Finds the pose of the next image and returns an ImageResult.\n\n"
           "timestamp: s, must grow. image: uint8 or uint16, (height, width) or (height, width, 3) in the "
           "order\n"
           "blue, green, red. mask: uint8 or bool, (height, width), not 0 where nothing is to be looked at.")
      .def(
          "finish", [](PySystem& self) { self.system().Finish(); }, py::call_guard<py::gil_scoped_release>(),
          "Makes the map and all poses final. To be called after the last image.")
      .def(
          "reset", [](PySystem& self) { self.system().Reset(); }, py::call_guard<py::gil_scoped_release>(),
          "Forgets all images and the map.")
      .def_property_readonly(
          "part_count", [](PySystem& self) { return self.system().PartCount(); },
          "How many worlds the trajectory falls into: 0 before there is a map.")
      .def(
          "poses", [](PySystem& self, size_t part) { return ToArray(self.system().Poses(part)); },
          py::arg("part") = 0,
          "Poses of images, (n, 8), at where the map puts them now; part 0 has the most.")
      .def(
          "keyframe_poses",
          [](PySystem& self, size_t part) { return ToArray(self.system().KeyframePoses(part)); },
          py::arg("part") = 0, "Poses of keyframes, (n, 8).")
      .def(
          "map", [](PySystem& self) { return self.system().Map(); }, "A copy of the map as it is now.")
      .def(
          "save_map", [](PySystem& self, const std::filesystem::path& file) { self.system().SaveMap(file); },
          py::arg("file"), "Writes the map, for `map` of another System and `dynamic_slam map`.")
      .def_property_readonly(
          "config", [](PySystem& self) { return self.system().ConfigYaml(); },
          "The value of every option, as YAML.")
      .def_property_readonly(
          "camera", [](PySystem& self) { return self.system().camera(); }, "Of the prepared images.");
}

}  // namespace dynamic_slam
