#include "dynamic_slam/map/map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

auto FindObservation(const std::vector<Observation>& observations, KeyframeId keyframe) {
  return std::lower_bound(
      observations.begin(), observations.end(), keyframe,
      [](const Observation& observation, KeyframeId id) { return observation.keyframe < id; });
}

// The keyframe's camera with lengths in the keyframe's own unit.
Sim3 OwnFromWorld(const Keyframe& keyframe) {
  const Rigid3& cam_from_world = keyframe.cam_from_world();
  return {1 / keyframe.unit(), cam_from_world.rotation, cam_from_world.translation / keyframe.unit()};
}

// The distances of all pairs: row i has those of i.
DS_DISPATCH_POPCNT
void AllDistances(const std::vector<const Descriptor*>& descriptors, std::vector<uint16_t>* distances) {
  const size_t count = descriptors.size();
  distances->assign(count * count, 0);
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < i; ++j) {
      (*distances)[i * count + j] = (*distances)[j * count + i] =
          static_cast<uint16_t>(HammingDistance(*descriptors[i], *descriptors[j]));
    }
  }
}

// The descriptor with the least median distance to the others.
size_t Medoid(const std::vector<const Descriptor*>& descriptors) {
  const size_t count = descriptors.size();
  std::vector<uint16_t> distances;
  AllDistances(descriptors, &distances);
  size_t best = 0;
  uint16_t best_median = std::numeric_limits<uint16_t>::max();
  for (size_t i = 0; i < count; ++i) {
    const auto row = distances.begin() + static_cast<std::ptrdiff_t>(i * count);
    const auto end = row + static_cast<std::ptrdiff_t>(count);
    // Few rows are better than the best so far, and to count is much quicker than to select.
    const auto smaller = std::count_if(row, end, [best_median](uint16_t d) { return d < best_median; });
    if (static_cast<size_t>(smaller) <= (count - 1) / 2) continue;
    const auto middle = row + static_cast<std::ptrdiff_t>((count - 1) / 2);
    std::nth_element(row, middle, end);
    best_median = *middle;
    best = i;
  }
  return best;
}

}  // namespace

bool Landmark::IsSeenBy(KeyframeId keyframe) const {
  const auto position = FindObservation(observations_, keyframe);
  return position != observations_.end() && position->keyframe == keyframe;
}

void Landmark::Transform(const Sim3& new_from_old) {
  position_ = new_from_old * position_;
  normal_ = new_from_old.rotation.cast<float>() * normal_;
  min_distance_ *= static_cast<float>(new_from_old.scale);
  max_distance_ *= static_cast<float>(new_from_old.scale);
  spread_ = static_cast<float>(new_from_old.scale) * (new_from_old.rotation.cast<float>() * spread_);
}

void Map::Reset() { Replace(Map(octave_scales_)); }

void Map::Replace(Map other) {
  const uint32_t epoch = epoch_, revision = revision_;
  *this = std::move(other);
  epoch_ = epoch + 1;
  revision_ = revision + 1;
}

Keyframe& Map::AddKeyframe(FrameId frame, double timestamp_s, const Rigid3& cam_from_world,
                           FeatureSet features, KeypointGrid grid, std::vector<float> static_probability,
                           PartId part) {
  std::vector<uint64_t> words = PlaceWords(features, static_probability, kMinStaticProbability);
  Keyframe& keyframe = keyframes_.Emplace(frame, timestamp_s, cam_from_world, std::move(features),
                                          std::move(grid), std::move(static_probability), part);
  KeyframeId& origin = origins_.at(part.value());
  if (!origin.IsValid()) origin = keyframe.id();
  places_.Add(keyframe.id(), std::move(words));
  return keyframe;
}

PartId Map::BeginPart() {
  if (keyframes_.size() > 0 || origins_.back().IsValid()) origins_.emplace_back();
  return PartId(static_cast<uint32_t>(origins_.size() - 1));
}

std::vector<PartId> Map::Parts() const {
  std::vector<PartId> parts;
  for (uint32_t part = 0; part < origins_.size(); ++part) {
    if (keyframes_.Contains(origins_[part])) parts.emplace_back(part);
  }
  // One that was split off may be older than what it was split from.
  std::sort(parts.begin(), parts.end(),
            [this](PartId a, PartId b) { return origins_[a.value()] < origins_[b.value()]; });
  return parts;
}

int Map::KeyframesIn(PartId part) const {
  int keyframes = 0;
  keyframes_.ForEach([&](const Keyframe& keyframe) { keyframes += keyframe.part() == part; });
  return keyframes;
}

bool Map::IsOrigin(KeyframeId id) const { return origins_[keyframes_.At(id).part().value()] == id; }

void Map::ErasePart(PartId part) {
  ++epoch_;
  BeginRevision();
  std::vector<LandmarkId> landmarks;
  landmarks_.ForEach([&](const Landmark& landmark) {
    if (landmark.observations().empty()) return;
    if (PartOf(landmark) == part) landmarks.push_back(landmark.id());
  });
  for (const LandmarkId id : landmarks) EraseLandmark(id);
  std::vector<KeyframeId> keyframes;
  keyframes_.ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() == part) keyframes.push_back(keyframe.id());
  });
  heirs_.resize(keyframes_.CreatedCount());
  for (const KeyframeId id : keyframes) {
    keyframes_.Erase(id);
    places_.Erase(id);
  }
}

void Map::MergePart(PartId from, PartId into, const Sim3& into_from_from) {
  DS_CHECK(from != into, "part={}", from.value());
  BeginRevision();
  landmarks_.ForEach([&](Landmark& landmark) {
    if (landmark.observations().empty()) return;
    if (PartOf(landmark) == from) landmark.Transform(into_from_from);
  });
  const Sim3 from_from_into = into_from_from.Inverse();
  keyframes_.ForEach([&](Keyframe& keyframe) {
    if (keyframe.part() != from) return;
    keyframe.set_cam_from_world(ToRigid3(ToSim3(keyframe.cam_from_world()) * from_from_into));
    keyframe.Rescale(into_from_from.scale);
    keyframe.part_ = into;
  });
  origins_[from.value()] = KeyframeId();
}

PartId Map::SplitPart(const std::vector<KeyframeId>& keyframes) {
  DS_CHECK(!keyframes.empty(), "keyframes={}", keyframes.size());
  BeginRevision();
  const PartId from = keyframes_.At(keyframes.front()).part();
  const PartId part = BeginPart();
  for (const KeyframeId id : keyframes) keyframes_.At(id).part_ = part;
  std::set<LandmarkId> changed;
  for (const KeyframeId id : keyframes) {
    const std::vector<LandmarkId> landmarks = keyframes_.At(id).landmarks_;
    for (const LandmarkId landmark : landmarks) {
      if (!landmarks_.Contains(landmark)) continue;
      const std::vector<Observation> observations = landmarks_.At(landmark).observations();
      const auto is_here = [&](const Observation& seen) {
        return keyframes_.At(seen.keyframe).part() == part;
      };
      const auto here = std::count_if(observations.begin(), observations.end(), is_here);
      const auto there = static_cast<std::ptrdiff_t>(observations.size()) - here;
      if (there == 0) continue;
      changed.insert(landmark);
      for (const Observation& seen : observations) {
        // It may fall with an earlier one.
        if (is_here(seen) != (here > there) && landmarks_.Contains(landmark))
          Unlink(seen.keyframe, seen.keypoint);
      }
    }
  }
  for (const LandmarkId landmark : changed) {
    if (landmarks_.Contains(landmark)) RefreshLandmark(landmark);
  }
  origins_[from.value()] = OldestOf(from);
  origins_[part.value()] = OldestOf(part);
  return part;
}

KeyframeId Map::OldestOf(PartId part) const {
  KeyframeId oldest;
  keyframes_.ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() == part && !oldest.IsValid()) oldest = keyframe.id();
  });
  return oldest;
}

void Map::Link(KeyframeId keyframe_id, uint32_t keypoint, LandmarkId landmark_id) {
  Keyframe& keyframe = keyframes_.At(keyframe_id);
  Landmark& landmark = landmarks_.At(landmark_id);
  DS_CHECK(!keyframe.landmarks_.at(keypoint).IsValid(), "keyframe={} keypoint={}", keyframe_id.value(),
           keypoint);
  const auto position = FindObservation(landmark.observations_, keyframe_id);
  DS_CHECK(position == landmark.observations_.end() || position->keyframe != keyframe_id,
           "keyframe={} landmark={}", keyframe_id.value(), landmark_id.value());
  for (const Observation& other : landmark.observations_) {
    keyframe.ChangeWeight(other.keyframe, 1);
    keyframes_.At(other.keyframe).ChangeWeight(keyframe_id, 1);
  }
  landmark.observations_.insert(position, {keyframe_id, keypoint});
  landmark.is_descriptor_stale_ = true;
  keyframe.SetLandmark(keypoint, landmark_id);
}

void Map::LinkAll(LandmarkId id, std::vector<Observation> observations) {
  Landmark& landmark = landmarks_.At(id);
  DS_CHECK(landmark.observations_.empty(), "landmark={}", id.value());
  for (const Observation& observation : observations)
    keyframes_.At(observation.keyframe).SetLandmark(observation.keypoint, id);
  landmark.observations_ = std::move(observations);
}

void Map::CountCovisibility() {
  std::vector<int> shared(keyframes_.CreatedCount());  // with each keyframe; all 0 between keyframes
  std::vector<KeyframeId> others;
  keyframes_.ForEach([&](Keyframe& keyframe) {
    others.clear();
    keyframe.ForEachLandmark([&](uint32_t, LandmarkId landmark) {
      for (const Observation& other : landmarks_.At(landmark).observations_) {
        if (shared[other.keyframe.value()]++ == 0) others.push_back(other.keyframe);
      }
    });
    std::sort(others.begin(), others.end());
    keyframe.covisible_.clear();
    for (const KeyframeId other : others) {
      if (other != keyframe.id()) keyframe.covisible_.push_back({other, shared[other.value()]});
      shared[other.value()] = 0;
    }
  });
}

void Map::Unlink(KeyframeId keyframe_id, uint32_t keypoint) {
  Keyframe& keyframe = keyframes_.At(keyframe_id);
  const LandmarkId landmark_id = keyframe.landmarks_.at(keypoint);
  Landmark& landmark = landmarks_.At(landmark_id);
  landmark.observations_.erase(FindObservation(landmark.observations_, keyframe_id));
  landmark.is_descriptor_stale_ = true;
  keyframe.SetLandmark(keypoint, LandmarkId());
  for (const Observation& other : landmark.observations_) {
    keyframe.ChangeWeight(other.keyframe, -1);
    keyframes_.At(other.keyframe).ChangeWeight(keyframe_id, -1);
  }
  if (landmark.observations_.size() < 2) EraseLandmark(landmark_id);
}

void Map::EraseLandmark(LandmarkId id) {
  const std::vector<Observation> observations = std::move(landmarks_.At(id).observations_);
  for (size_t i = 0; i < observations.size(); ++i) {
    Keyframe& keyframe = keyframes_.At(observations[i].keyframe);
    keyframe.SetLandmark(observations[i].keypoint, LandmarkId());
    for (size_t j = 0; j < observations.size(); ++j) {
      if (j != i) keyframe.ChangeWeight(observations[j].keyframe, -1);
    }
  }
  landmarks_.Erase(id);
}

void Map::EraseKeyframe(KeyframeId id, KeyframeId heir) {
  DS_CHECK(id != heir && keyframes_.Contains(heir), "id={} heir={}", id.value(), heir.value());
  const std::vector<LandmarkId> landmarks = keyframes_.At(id).landmarks_;
  for (uint32_t keypoint = 0; keypoint < landmarks.size(); ++keypoint) {
    // A landmark may fall with an earlier link of this loop: look again.
    if (keyframes_.At(id).landmarks_[keypoint].IsValid()) Unlink(id, keypoint);
  }
  if (heirs_.size() <= id.value()) heirs_.resize(id.value() + 1);
  heirs_[id.value()] = {heir, OwnFromWorld(keyframes_.At(id)) * OwnFromWorld(keyframes_.At(heir)).Inverse()};
  const PartId part = keyframes_.At(id).part();
  const bool is_origin = IsOrigin(id);
  keyframes_.Erase(id);
  places_.Erase(id);
  if (is_origin) origins_[part.value()] = OldestOf(part);
}

void Map::MergeLandmarks(LandmarkId from, LandmarkId into) {
  DS_CHECK(from != into, "id={}", from.value());
  const std::vector<Observation> observations = landmarks_.At(from).observations_;
  const int found = landmarks_.At(from).found_count, visible = landmarks_.At(from).visible_count;
  const float static_log_odds = landmarks_.At(from).static_log_odds;
  EraseLandmark(from);
  Landmark& survivor = landmarks_.At(into);
  for (const Observation& observation : observations) {
    if (!survivor.IsSeenBy(observation.keyframe)) Link(observation.keyframe, observation.keypoint, into);
  }
  survivor.found_count += found;
  survivor.visible_count += visible;
  // Evidence of one point, from different sightings.
  survivor.static_log_odds =
      std::clamp(survivor.static_log_odds + static_log_odds, -kMaxStaticLogOdds, kMaxStaticLogOdds);
  merges_.Add(from, into);
  RefreshLandmark(into);
}

LandmarkId Map::Resolve(LandmarkId id) const {
  while (id.IsValid() && !landmarks_.Contains(id)) {
    id = merges_.Into(id);
  }
  return id;
}

void Map::RefreshLandmark(LandmarkId id) {
  Landmark& landmark = landmarks_.At(id);
  const size_t count = landmark.observations_.size();
  if (count == 0) return;

  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double log_distance_sum = 0;
  struct Sight {
    Eigen::Vector3d direction;  // from the camera to the landmark
    double scale;               // of the keypoint's octave
  };
  std::vector<Sight> sights;
  sights.reserve(count);
  for (const Observation& observation : landmark.observations_) {
    const Keyframe& keyframe = keyframes_.At(observation.keyframe);
    const Eigen::Vector3d direction = landmark.position_ - keyframe.CenterInWorld();
    const double distance = direction.norm();
    normal += direction / std::max(distance, 1e-12);
    // Seen in octave o at this distance, it would be seen in octave 0 from `scale` times as far.
    const float scale = octave_scales_[static_cast<size_t>(keyframe.keypoint(observation.keypoint).octave)];
    log_distance_sum += std::log(std::max(distance, 1e-12) * scale);
    sights.push_back({direction, scale});
  }
  landmark.normal_ = normal.normalized().cast<float>();
  landmark.max_distance_ = static_cast<float>(std::exp(log_distance_sum / static_cast<double>(count)));
  landmark.min_distance_ = landmark.max_distance_ / octave_scales_.back();

  // An observation tells of a move along the normal what it sees from aside.
  double information = 0;
  const Eigen::Vector3d mean = landmark.normal_.cast<double>();
  for (const Sight& sight : sights) {
    const double spread = sight.direction.squaredNorm() * sight.scale;
    information += sight.direction.cross(mean).squaredNorm() / std::max(spread * spread, 1e-24);
  }
  landmark.spread_ = landmark.normal_ / static_cast<float>(std::sqrt(std::max(information, 1e-24)));

  if (!landmark.is_descriptor_stale_) return;
  std::vector<const Descriptor*> descriptors;
  descriptors.reserve(count);
  for (const Observation& observation : landmark.observations_) {
    const Keyframe& keyframe = keyframes_.At(observation.keyframe);
    descriptors.push_back(&keyframe.features().descriptors[observation.keypoint]);
  }
  landmark.descriptor_ = *descriptors[count > 2 ? Medoid(descriptors) : count - 1];
  landmark.is_descriptor_stale_ = false;
}

Map::Anchor Map::ResolveKeyframe(KeyframeId id) const {
  Anchor anchor{id, Sim3()};
  while (anchor.keyframe.IsValid() && !keyframes_.Contains(anchor.keyframe)) {
    DS_CHECK(anchor.keyframe.value() < heirs_.size(), "id={}", id.value());
    const Anchor& heir = heirs_[anchor.keyframe.value()];
    anchor = {heir.keyframe, anchor.original_from_keyframe * heir.original_from_keyframe};
  }
  return anchor;
}

Rigid3 Map::PoseFromReference(KeyframeId reference, const Rigid3& cam_from_reference) const {
  const Anchor anchor = ResolveKeyframe(reference);
  const Sim3 own_from_world = ToSim3(cam_from_reference) * anchor.original_from_keyframe *
                              OwnFromWorld(keyframes_.At(anchor.keyframe));
  return ToRigid3(own_from_world);
}

Rigid3 Map::CamFromReference(KeyframeId reference, const Rigid3& cam_from_world) const {
  const Anchor anchor = ResolveKeyframe(reference);
  const Sim3 own_from_world = anchor.original_from_keyframe * OwnFromWorld(keyframes_.At(anchor.keyframe));
  // With the world's unit of length for the camera's, as ToRigid3 has it.
  const Sim3 cam_from_reference =
      Sim3{own_from_world.scale, cam_from_world.rotation, own_from_world.scale * cam_from_world.translation} *
      own_from_world.Inverse();
  return {cam_from_reference.rotation, cam_from_reference.translation};
}

PartId Map::PartOf(KeyframeId reference) const {
  const Keyframe* keyframe = keyframes_.Find(ResolveKeyframe(reference).keyframe);
  return keyframe != nullptr ? keyframe->part() : PartId();
}

double Map::UnitOf(KeyframeId reference) const {
  return keyframes_.At(ResolveKeyframe(reference).keyframe).unit();
}

double Map::MedianDepth(KeyframeId id) const {
  const Keyframe& keyframe = keyframes_.At(id);
  std::vector<double> depths;
  keyframe.ForEachLandmark([&](uint32_t, LandmarkId landmark) {
    depths.push_back((keyframe.cam_from_world() * landmarks_.At(landmark).position()).z());
  });
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

std::vector<std::string> Map::Validate() const {
  std::vector<std::string> problems;
  std::map<std::pair<KeyframeId, KeyframeId>, int> weights;
  landmarks_.ForEach([&](const Landmark& landmark) {
    const uint32_t id = landmark.id().value();
    if (landmark.observations().size() < 2)
      problems.push_back(fmt::format("landmark {}: fewer than two observations", id));
    if (!landmark.position().allFinite())
      problems.push_back(fmt::format("landmark {}: position is not finite", id));
    KeyframeId previous;
    for (const Observation& observation : landmark.observations()) {
      const Keyframe* keyframe = keyframes_.Find(observation.keyframe);
      if (keyframe != nullptr && keyframe->part() != PartOf(landmark)) {
        problems.push_back(fmt::format("landmark {}: seen in two parts of the map", id));
      }
      if (previous.IsValid() && observation.keyframe <= previous) {
        problems.push_back(fmt::format("landmark {}: observations are not in the order of keyframes", id));
      }
      previous = observation.keyframe;
      if (keyframe == nullptr || observation.keypoint >= keyframe->landmarks().size() ||
          keyframe->landmarks()[observation.keypoint] != landmark.id()) {
        problems.push_back(
            fmt::format("landmark {}: keyframe {} does not know of it", id, observation.keyframe.value()));
      }
      for (const Observation& other : landmark.observations()) {
        if (other.keyframe != observation.keyframe) ++weights[{observation.keyframe, other.keyframe}];
      }
    }
  });
  keyframes_.ForEach([&](const Keyframe& keyframe) {
    const uint32_t id = keyframe.id().value();
    if (!keyframe.cam_from_world().IsFinite())
      problems.push_back(fmt::format("keyframe {}: pose is not finite", id));
    int count = 0;
    for (uint32_t keypoint = 0; keypoint < keyframe.landmarks().size(); ++keypoint) {
      const LandmarkId landmark_id = keyframe.landmarks()[keypoint];
      if (!landmark_id.IsValid()) continue;
      ++count;
      const Landmark* landmark = landmarks_.Find(landmark_id);
      if (landmark == nullptr || !landmark->IsSeenBy(keyframe.id())) {
        problems.push_back(
            fmt::format("keyframe {}: keypoint {} links a landmark that does not link back", id, keypoint));
      }
    }
    if (!keyframes_.Contains(origins_[keyframe.part().value()]) ||
        keyframes_.At(origins_[keyframe.part().value()]).part() != keyframe.part()) {
      problems.push_back(fmt::format("keyframe {}: its part has no origin", id));
    }
    int listed = 0;
    keyframe.ForEachLandmark([&](uint32_t, LandmarkId landmark) { listed += landmark.IsValid() ? 1 : 0; });
    if (count != keyframe.LandmarkCount() || count != listed)
      problems.push_back(fmt::format("keyframe {}: counts its landmarks wrongly", id));
    for (const CovisibleKeyframe& other : keyframe.covisible()) {
      const auto weight = weights.find({keyframe.id(), other.id});
      if (weight == weights.end() || weight->second != other.weight) {
        problems.push_back(fmt::format("keyframe {}: wrong covisibility with {}", id, other.id.value()));
      } else {
        weights.erase(weight);
      }
    }
  });
  for (const auto& [pair, weight] : weights) {
    problems.push_back(
        fmt::format("keyframe {}: lacks covisibility with {}", pair.first.value(), pair.second.value()));
  }
  return problems;
}

}  // namespace dynamic_slam
