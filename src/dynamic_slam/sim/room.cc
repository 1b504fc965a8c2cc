#include "dynamic_slam/sim/room.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/sim/hand_held_path.h"

namespace dynamic_slam {
namespace {

const Eigen::Vector3d kRoomSize(6.0, 5.0, 3.0);  // m
constexpr double kEyeHeight = 1.5;               // m
constexpr double kTexelsPerMetre = 320;

// Parts of the seed.
enum SeedPart : uint64_t { kWalls, kFurniture, kPath, kHeading, kNoise };

// Boxes on the floor and under the ceiling, clear of each other and of the camera's reach, most of them
// ahead.
void AddFurniture(Scene& scene, uint64_t seed, double heading_rad) {
  Random random(seed);
  struct Place {
    Eigen::Vector2d centre;
    double radius;
  };
  std::vector<Place> taken = {{Eigen::Vector2d::Zero(), HandHeldPath::kReach + 0.1}};
  constexpr int kWanted = 12, kTrials = 1000;
  int placed = 0;
  for (int trial = 0; trial < kTrials && placed < kWanted; ++trial) {
    const double tall = random.Uniform(0.3, 1.9), width = random.Uniform(0.3, 0.8),
                 depth = random.Uniform(0.3, 0.8);
    const Eigen::Vector3d size(depth, width, tall);
    const double radius = 0.5 * size.head<2>().norm();
    const double spread_rad = random.Index(4) == 0 ? std::numbers::pi : 0.9;
    const double direction_rad = heading_rad + random.Uniform(-spread_rad, spread_rad);
    const Eigen::Vector2d centre =
        random.Uniform(1.2, 3.5) * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad));
    const bool in_room = (centre.cwiseAbs() - 0.5 * kRoomSize.head<2>()).maxCoeff() < -radius;
    const double angle_rad = random.Uniform(0, std::numbers::pi);
    const bool hangs = random.Index(4) == 0;
    const bool clear = in_room && std::all_of(taken.begin(), taken.end(), [&](const Place& place) {
                         return (place.centre - centre).norm() > place.radius + radius;
                       });
    if (!clear) continue;
    const double height = hangs ? kRoomSize.z() - 0.5 * size.z() - random.Uniform(0.1, 0.8) : 0.5 * size.z();
    const Rigid3 world_from_box(ExpSo3({0, 0, angle_rad}), {centre.x(), centre.y(), height});
    AddBox(scene, SubSeed(seed, static_cast<uint64_t>(trial)), world_from_box, size, false, kTexelsPerMetre);
    taken.push_back({centre, radius});
    ++placed;
  }
}

double Heading(uint64_t seed) { return Random(SubSeed(seed, kHeading)).Uniform(0, 2.0 * std::numbers::pi); }

Scene MakeRoomScene(uint64_t seed) {
  Scene scene;
  const Rigid3 world_from_room(Eigen::Quaterniond::Identity(), {0, 0, 0.5 * kRoomSize.z()});
  AddBox(scene, SubSeed(seed, kWalls), world_from_room, kRoomSize, true, kTexelsPerMetre);
  AddFurniture(scene, SubSeed(seed, kFurniture), Heading(seed));
  return scene;
}

Trajectory MakeTruth(const RoomOptions& options) {
  const HandHeldPath path(SubSeed(options.seed, kPath), {0, 0, kEyeHeight}, Heading(options.seed));
  Trajectory truth;
  for (int i = 0; i < options.frames; ++i) {
    const double time_s = i / options.camera.fps;
    truth.push_back({time_s, path.At(time_s)});
  }
  return truth;
}

RoomOptions Checked(const RoomOptions& options) {
  options.camera.Validate();
  if (options.frames < 1) throw InputError("frames", fmt::format("{} is not positive", options.frames), "");
  if (!(options.camera.fps > 0)) {
    throw InputError(fmt::format("camera '{}'", options.camera.name), "has no frame rate", "State its fps.");
  }
  if (!(options.noise_grey >= 0 && options.noise_grey <= 50)) {
    throw InputError("noise", fmt::format("{} is not within 0 to 50 grey levels", options.noise_grey), "");
  }
  return options;
}

// Gaussian noise from a table: the logarithm and cosine of each pixel would take longer than the picture.
void AddNoise(uint64_t seed, double sigma, cv::Mat& image) {
  if (sigma == 0) return;
  Random random(seed);
  std::array<float, 4096> table;
  for (float& value : table) value = static_cast<float>(sigma * random.Gaussian());
  for (int row = 0; row < image.rows; ++row) {
    uint8_t* pixels = image.ptr<uint8_t>(row);
    for (int column = 0; column < image.cols;) {
      uint64_t bits = random.Next();
      for (const int end = std::min(column + 5, image.cols); column < end; ++column, bits >>= 12) {
        pixels[column] = cv::saturate_cast<uint8_t>(static_cast<float>(pixels[column]) + table[bits & 4095]);
      }
    }
  }
}

class RoomSource : public FrameSource {
 public:
  explicit RoomSource(const Room& room) : room_(room) {}

  std::optional<SourceImage> Next() override {
    if (next_ >= room_.options().frames) return std::nullopt;
    const int index = next_++;
    return SourceImage{room_.truth()[index].timestamp_s, room_.Frame(index), fmt::format("frame {}", index)};
  }
  size_t FrameCount() const override { return room_.truth().size(); }
  std::string Layout() const override { return "simulated"; }
  std::optional<Camera> OwnCamera() const override { return room_.options().camera; }
  cv::Size ImageSize() const override {
    return {room_.options().camera.width, room_.options().camera.height};
  }
  const std::vector<SourceProblem>& Problems() const override { return no_problems_; }

 private:
  const Room& room_;
  int next_ = 0;
  std::vector<SourceProblem> no_problems_;
};

}  // namespace

Camera DefaultRoomCamera() {
  Camera camera;
  camera.name = "room";
  camera.width = 640;
  camera.height = 480;
  camera.fps = 30;
  camera.fx = 535.4;
  camera.fy = 539.2;
  camera.cx = 320.1;
  camera.cy = 247.6;
  return camera;
}

Room::Room(const RoomOptions& options)
    : options_(Checked(options)),
      scene_(MakeRoomScene(options.seed)),
      renderer_(options.camera),
      truth_(MakeTruth(options)) {}

cv::Mat Room::Frame(int index) const {
  DS_CHECK(index >= 0 && index < options_.frames, "index={} frames={}", index, options_.frames);
  cv::Mat image = Render(truth_[index].world_from_cam);
  const uint64_t noise_seed = SubSeed(SubSeed(options_.seed, kNoise), static_cast<uint64_t>(index));
  AddNoise(noise_seed, options_.noise_grey, image);
  return image;
}

std::unique_ptr<FrameSource> MakeRoomSource(const Room& room) { return std::make_unique<RoomSource>(room); }

}  // namespace dynamic_slam
