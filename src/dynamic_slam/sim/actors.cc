#include "dynamic_slam/sim/actors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamic_slam/sim/car.h"
#include "dynamic_slam/sim/person.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

// A person who follows a path at a speed of his own.
class Walker : public Actor {
 public:
  Walker(Person person, int object, const PlanarPath& path, double start_m, double speed_m_per_s)
      : person_(std::move(person)),
        object_(object),
        path_(path),
        start_m_(start_m),
        speed_m_per_s_(speed_m_per_s) {
    // Faster walkers take longer steps; 1.4 m, two steps, at 1.3 m/s.
    stride_m_ = 0.8 * person_.height_m() * std::sqrt(speed_m_per_s / 1.3);
  }

  void Place(double time_s, std::vector<MeshInstance>* instances,
             std::vector<GroundShadow>* shadows) const override {
    const double walked_m = start_m_ + speed_m_per_s_ * time_s;
    const PlanarPath::Place place = path_.At(walked_m);
    const double phase = stride_m_ > 0 ? walked_m / stride_m_ : 0;
    person_.Place({place.position, place.heading_rad, phase, stride_m_}, object_, instances, shadows);
  }

 private:
  Person person_;
  int object_;
  PlanarPath path_;
  double start_m_, speed_m_per_s_, stride_m_;
};

// A car that follows a lane.
class Driver : public Actor {
 public:
  Driver(uint64_t seed, int object, const PlanarPath& lane, double start_m, double speed_m_per_s)
      : car_(seed), object_(object), lane_(lane), start_m_(start_m), speed_m_per_s_(speed_m_per_s) {}

  void Place(double time_s, std::vector<MeshInstance>* instances,
             std::vector<GroundShadow>* shadows) const override {
    // The axles are on the lane: the body lies along their chord.
    const double driven_m = start_m_ + speed_m_per_s_ * time_s, half_m = 0.3 * car_.length_m();
    const Eigen::Vector2d rear = lane_.At(driven_m - half_m).position,
                          front = lane_.At(driven_m + half_m).position;
    const Eigen::Vector2d along = front - rear;
    car_.Place(0.5 * (front + rear), std::atan2(along.y(), along.x()), driven_m, object_, instances, shadows);
  }

 private:
  Car car_;
  int object_;
  PlanarPath lane_;
  double start_m_, speed_m_per_s_;
};

// Cars on the lanes: a third in the camera's own, as fast as it, the others in the other one.
void AddDrivers(const SceneOptions& options, World& world, std::vector<std::unique_ptr<Actor>>* actors) {
  if (world.lanes.empty()) return;
  Random random(SubSeed(options.seed, 4));
  const double speed = options.camera.motion == "path" ? options.camera.speed_m_per_s : 8;
  const double other_speed = random.Uniform(7, 9);
  const int own = (options.cars.moving + 2) / 3, others = options.cars.moving - own;
  for (int i = 0; i < options.cars.moving; ++i) {
    const bool is_own = i < own;
    const PlanarPath& lane = world.lanes[is_own ? 0 : world.lanes.size() - 1];
    // The nearest in the own lane stays in view; no two share a place.
    const double room = lane.length_m() - 2 * world.car_gap_m;
    const double start_m = is_own ? world.car_gap_m + room * (i + random.Uniform(0, 0.3)) / own
                                  : lane.length_m() * (i - own + random.Uniform(0, 0.6)) / others;
    actors->push_back(std::make_unique<Driver>(SubSeed(options.seed, 5000 + static_cast<uint64_t>(i)),
                                               world.AddObject("car", true), lane, start_m,
                                               is_own ? speed : other_speed));
  }
}

// Ways to and fro across the view, one behind the other, that end where the view does. Whoever comes back has
// half a metre to those who go.
std::vector<PlanarPath> WalksBefore(const World& world, const PeopleOptions& people) {
  const Eigen::Vector2d centre = world.camera_centre.head<2>();
  const Eigen::Vector2d ahead = (world.camera_target - world.camera_centre).head<2>().normalized();
  const Eigen::Vector2d left(-ahead.y(), ahead.x());
  std::vector<PlanarPath> walks;
  for (int i = 0; i * people.per_row < people.count; ++i) {
    const double distance_m = people.nearest_m + 0.95 * i;
    const Eigen::Vector2d middle = centre + distance_m * ahead, reach = 0.42 * distance_m * left;
    walks.push_back(PlanarPath::ToAndFro(middle - reach, middle + reach, 0.5));
  }
  return walks;
}

// Ways along the line of sight, side by side: from where somebody fills the height of the image to where the
// desks begin.
std::vector<PlanarPath> WalksTowards(const World& world, int count) {
  const Eigen::Vector2d centre = world.camera_centre.head<2>();
  const Eigen::Vector2d sight = (world.camera_target - world.camera_centre).head<2>();
  const Eigen::Vector2d ahead = sight.normalized(), left(-ahead.y(), ahead.x());
  std::vector<PlanarPath> walks;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d shift = 0.9 * (i - 0.5 * (count - 1)) * left;
    walks.push_back(PlanarPath::ToAndFro(centre + 1.3 * ahead + shift,
                                         centre + std::max(2.0, sight.norm() - 1.2) * ahead + shift, 0.4));
  }
  return walks;
}

std::vector<PlanarPath> WalksOf(const PeopleOptions& people, const World& world) {
  if (people.towards_camera) return WalksTowards(world, people.count);
  if (people.near_camera) return WalksBefore(world, people);
  return world.walks;
}

}  // namespace

std::vector<std::unique_ptr<Actor>> MakeActors(const SceneOptions& options, World& world) {
  std::vector<std::unique_ptr<Actor>> actors;
  Random random(SubSeed(options.seed, 2));
  const std::vector<PlanarPath> walks = WalksOf(options.people, world);
  for (int i = 0; i < options.people.count && !walks.empty(); ++i) {
    const PlanarPath& walk = walks[static_cast<size_t>(i) % walks.size()];
    // Those who share a path keep their distance: they start apart and walk equally fast.
    Random own(SubSeed(SubSeed(options.seed, 3), static_cast<uint64_t>(i) % walks.size()));
    const int on_path = i / static_cast<int>(walks.size());
    const int sharing =
        (options.people.count - 1 - i % static_cast<int>(walks.size())) / static_cast<int>(walks.size()) + 1;
    const double start_m = walk.length_m() * (own.Uniform() + static_cast<double>(on_path) / sharing);
    const double speed = options.people.speed_m_per_s * own.Uniform(0.8, 1.2);
    actors.push_back(std::make_unique<Walker>(
        Person(SubSeed(options.seed, 1000 + static_cast<uint64_t>(i)), options.people.richness),
        world.AddObject("person", true), walk, start_m, speed));
  }
  AddDrivers(options, world, &actors);
  return actors;
}

}  // namespace dynamic_slam
