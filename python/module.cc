// import dynamic_slam: the public API for Python, with numpy's arrays for images, poses and points.

#include <map>
#include <string>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "dynamic_slam/dynamic_slam.h"
#include "system_binding.h"

namespace py = pybind11;

namespace dynamic_slam {
namespace {

template <class T>
T Choose(const std::map<std::string, T>& choices, const std::string& name, const char* argument) {
  if (const auto found = choices.find(name); found != choices.end()) return found->second;
  std::string known;
  for (const auto& [choice, value] : choices) known += (known.empty() ? "'" : ", '") + choice + "'";
  throw py::value_error(std::string(argument) + " must be one of " + known + ", not '" + name + "'");
}

void BindCamera(py::module_& module) {
  py::class_<Camera>(module, "Camera",
                     "A camera with a lens of the model 'radial_tangential' or 'kannala_brandt'.")
      .def(
          py::init([](int width, int height, double fx, double fy, double cx, double cy, double fps,
                      const std::string& model, const std::vector<double>& distortion,
                      const std::string& name, double readout_s) {
            Camera camera{.name = name,
                          .width = width,
                          .height = height,
                          .fps = fps,
                          .fx = fx,
                          .fy = fy,
                          .cx = cx,
                          .cy = cy};
            camera.model = Choose<LensModel>({{"radial_tangential", LensModel::kRadialTangential},
                                              {"kannala_brandt", LensModel::kKannalaBrandt}},
                                             model, "model");
            const bool is_fisheye = camera.model == LensModel::kKannalaBrandt;
            double* const brown[] = {&camera.k1, &camera.k2, &camera.p1, &camera.p2, &camera.k3};
            double* const fisheye[] = {&camera.k1, &camera.k2, &camera.k3, &camera.k4};
            const size_t most = is_fisheye ? std::size(fisheye) : std::size(brown);
            if (distortion.size() > most) {
              throw py::value_error("distortion must have at most " + std::to_string(most) +
                                    " numbers, not " + std::to_string(distortion.size()));
            }
            for (size_t i = 0; i < distortion.size(); ++i)
              *(is_fisheye ? fisheye[i] : brown[i]) = distortion[i];
            camera.readout_s = readout_s;
            camera.Validate();
            return camera;
          }),
          py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"),
          py::kw_only(), py::arg("fps") = 0.0, py::arg("model") = "radial_tangential",
          py::arg("distortion") = std::vector<double>(), py::arg("name") = "", py::arg("readout_s") = 0.0,
          "All in px. distortion: k1 k2 p1 p2 k3, or k1 k2 k3 k4 of kannala_brandt, as in OpenCV. readout_s: "
          "of a rolling shutter, from the first row to the last.")
      .def_readonly("name", &Camera::name)
      .def_readonly("width", &Camera::width, "px")
      .def_readonly("height", &Camera::height, "px")
      .def_readonly("fps", &Camera::fps, "Images a second; 0 when unknown.")
      .def_readonly("fx", &Camera::fx, "px")
      .def_readonly("fy", &Camera::fy, "px")
      .def_readonly("cx", &Camera::cx, "px")
      .def_readonly("cy", &Camera::cy, "px")
      .def_readonly("readout_s", &Camera::readout_s, "Of a rolling shutter, s; 0: all rows at once.")
      .def("__repr__", [](const Camera& camera) {
        return "<Camera '" + camera.name + "' " + std::to_string(camera.width) + " x " +
               std::to_string(camera.height) + ">";
      });
  module.def("load_camera", &LoadCamera, py::arg("name_or_file"),
             "A known camera, or that of a camera file.");
  module.def("known_cameras", &KnownCameras, "Names that load_camera knows.");
}

void BindSource(py::module_& module) {
  py::class_<FrameSource>(module, "Source", "Images of a sequence: iterates over (timestamp, image, name).")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__",
           [](FrameSource& self) {
             std::optional<SourceImage> image;
             {
               py::gil_scoped_release no_gil;
               image = self.Next();
             }
             if (!image) throw py::stop_iteration();
             return py::make_tuple(image->timestamp_s, ToArray(image->image), image->name);
           })
      .def("__len__", &FrameSource::FrameCount)
      .def_property_readonly("layout", &FrameSource::Layout, "'tum', 'kitti', 'euroc', 'images' or 'video'.")
      .def_property_readonly("camera", &FrameSource::OwnCamera,
                             "The camera that the source describes, or None.")
      .def_property_readonly(
          "problems",
          [](const FrameSource& self) {
            std::vector<std::pair<std::string, std::string>> problems;
            for (const SourceProblem& problem : self.Problems())
              problems.emplace_back(problem.name, problem.reason);
            return problems;
          },
          "What was skipped so far: (name, reason) of each.");
  module.def(
      "open_source",
      [](const std::filesystem::path& path, double fps, int start, int max_frames) {
        return OpenFrameSource(path, {.fps = fps, .start = start, .max_frames = max_frames});
      },
      py::arg("path"), py::kw_only(), py::arg("fps") = 0.0, py::arg("start") = 0, py::arg("max_frames") = 0,
      "Opens a folder in TUM RGB-D, KITTI or EuRoC layout, a folder of images or a video.");
}

void BindMap(py::module_& module) {
  py::class_<MapView::Part>(module, "MapPart", "A part of a map: one world with one unit of length.")
      .def_property_readonly(
          "keyframes", [](const MapView::Part& self) { return ToArray(self.keyframes); }, "Poses, (n, 8).")
      .def_property_readonly(
          "landmarks",
          [](const MapView::Part& self) {
            py::array_t<double> points({static_cast<py::ssize_t>(self.landmarks.size()), py::ssize_t{3}});
            auto rows = points.mutable_unchecked<2>();
            for (size_t i = 0; i < self.landmarks.size(); ++i) {
              for (int k = 0; k < 3; ++k)
                rows(static_cast<py::ssize_t>(i), k) = self.landmarks[i].position[k];
            }
            return points;
          },
          "Points in the world, (m, 3).")
      .def_property_readonly(
          "observations",
          [](const MapView::Part& self) {
            std::vector<int> counts;
            for (const MapView::Landmark& landmark : self.landmarks) counts.push_back(landmark.observations);
            return py::array_t<int>(static_cast<py::ssize_t>(counts.size()), counts.data());
          },
          "How many keyframes see each landmark, (m,).")
      .def_property_readonly(
          "static_log_odds",
          [](const MapView::Part& self) {
            std::vector<double> odds;
            for (const MapView::Landmark& landmark : self.landmarks) odds.push_back(landmark.static_log_odds);
            return py::array_t<double>(static_cast<py::ssize_t>(odds.size()), odds.data());
          },
          "Log of P(at rest) / P(moves) of each landmark, (m,); 0 where nothing speaks for either.");
  py::class_<MapView>(module, "Map", "A copy of what a map holds at one moment.")
      .def_readonly("camera", &MapView::camera)
      .def_readonly("parts", &MapView::parts, "List of MapPart, the one with the most keyframes first.");
  module.def("read_map", &ReadMap, py::arg("file"),
             "Reads a map that System.save_map or run --save-map wrote.");
  module.def("export_map", &ExportMap, py::arg("file"), py::arg("folder"), py::arg("part") = 1,
             "Writes map.ply, keyframes.txt and colmap/ of a part of a map file into the folder.");
}

void BindEvaluation(py::module_& module) {
  py::class_<ErrorStatistics>(module, "Statistics", "Statistics of errors.")
      .def_readonly("n", &ErrorStatistics::n)
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("std", &ErrorStatistics::std)
      .def_readonly("min", &ErrorStatistics::min)
      .def_readonly("max", &ErrorStatistics::max)
      .def_readonly("sse", &ErrorStatistics::sse);
  py::class_<TrajectoryErrors>(module, "Errors", "What evaluate() finds.")
      .def_readonly("translation", &TrajectoryErrors::translation_m, "Statistics, m.")
      .def_readonly("rotation", &TrajectoryErrors::rotation_deg, "Statistics, deg.")
      .def_property_readonly(
          "scale", [](const TrajectoryErrors& self) { return self.reference_from_estimate.scale; },
          "By which the estimate was multiplied.");
  module.def(
      "evaluate",
      [](const py::object& reference, const py::object& estimate, const std::string& metric,
         const std::string& align, double max_dt, double delta, const std::string& delta_unit) {
        const Alignment alignment = Choose<Alignment>(
            {{"none", Alignment::kNone}, {"se3", Alignment::kSe3}, {"sim3", Alignment::kSim3}}, align,
            "align");
        const bool is_absolute = Choose<bool>({{"ape", true}, {"rpe", false}}, metric, "metric");
        const RpeOptions rpe{
            delta, Choose<DeltaUnit>({{"frames", DeltaUnit::kFrames}, {"m", DeltaUnit::kMetres}}, delta_unit,
                                     "delta_unit")};
        const PoseList truth = ToPoseList(ToTrajectory(reference, "reference"));
        const MatchedPoses poses = MatchByTime(truth, ToPoseList(ToTrajectory(estimate, "estimate")), max_dt);
        return is_absolute ? AbsolutePoseError(poses, alignment) : RelativePoseError(poses, alignment, rpe);
      },
      py::arg("reference"), py::arg("estimate"), py::kw_only(), py::arg("metric") = "ape",
      py::arg("align") = "sim3", py::arg("max_dt") = 0.01, py::arg("delta") = 1.0,
      py::arg("delta_unit") = "frames",
      "Errors of a trajectory against the true one, both (n, 8), as evo computes them.\n\n"
      "metric: 'ape' or 'rpe'. align: 'sim3', 'se3' or 'none'. max_dt: largest difference of two stamps, s.\n"
      "delta, delta_unit: of the pairs of rpe, in 'frames' or 'm'.");
  module.def(
      "read_trajectory", [](const std::filesystem::path& file) { return ToArray(ReadTumTrajectory(file)); },
      py::arg("file"), "Reads a trajectory in TUM's format, (n, 8).");
  module.def(
      "write_trajectory",
      [](const std::filesystem::path& file, const py::object& poses) {
        WriteTumTrajectory(file, ToTrajectory(poses, "poses"));
      },
      py::arg("file"), py::arg("poses"), "Writes poses, (n, 8), in TUM's format.");
}

}  // namespace
}  // namespace dynamic_slam

PYBIND11_MODULE(_core, module) {
  using namespace dynamic_slam;
  py::register_exception<InputError>(module, "InputError", PyExc_ValueError).attr("__doc__") =
      "What was given is wrong: a file, an option, an image. The message says what, why and what to do.";
  BindCamera(module);
  BindSource(module);
  BindMap(module);
  BindEvaluation(module);
  BindSystem(module);
}
