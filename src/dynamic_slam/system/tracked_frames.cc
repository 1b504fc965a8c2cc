#include "dynamic_slam/system/tracked_frames.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "dynamic_slam/geometry/path_leaps.h"
#include "dynamic_slam/optimize/path_smoother.h"

namespace dynamic_slam {
namespace {

// With this share of its frames on one side of all leaps it is clear which side stands wrong: the other.
constexpr double kNearlyAll = 0.75;

// By fewer poses that were found again nobody can tell whether a piece stands wrong.
constexpr int kMinFound = 5;

Rigid3 CamFromWorld(const Map& map, const AnchoredPose& pose) {
  return map.PoseFromReference(pose.reference, pose.cam_from_reference);
}

// SmoothPath, with the stamps.
Trajectory Smoothed(const Trajectory& path) {
  const std::vector<Rigid3> poses = SmoothPath(path);
  Trajectory smooth;
  for (size_t i = 0; i < path.size(); ++i) smooth.push_back({path[i].timestamp_s, poses[i]});
  return smooth;
}

}  // namespace

TrackedFrames::TrackedFrame::TrackedFrame(const AnchoredPose& pose, bool is_live_in)
    : timestamp_s(pose.timestamp_s), reference(pose.reference), is_live(is_live_in) {
  Eigen::Map<Eigen::Vector4f>(rotation_xyzw.data()) = pose.cam_from_reference.rotation.coeffs().cast<float>();
  Eigen::Map<Eigen::Vector3f>(translation.data()) = pose.cam_from_reference.translation.cast<float>();
}

AnchoredPose TrackedFrames::TrackedFrame::Pose() const {
  const Eigen::Map<const Eigen::Quaternionf> rotation(rotation_xyzw.data());
  const Eigen::Map<const Eigen::Vector3f> cam_from_reference(translation.data());
  return {timestamp_s, reference, Rigid3(rotation.cast<double>(), cam_from_reference.cast<double>())};
}

void TrackedFrames::RemoveThoseOfErasedParts() {
  const auto map = map_->Read();
  std::vector<TrackedFrame> left = All();
  std::erase_if(left, [&](const TrackedFrame& frame) { return !map->PartOf(frame.reference).IsValid(); });
  frames_.Assign(left);
}

void TrackedFrames::AddFound(std::span<const AnchoredPose> poses) {
  std::set<double> stamps;
  for (const AnchoredPose& pose : poses) stamps.insert(pose.timestamp_s);
  std::vector<TrackedFrame> all = All();
  std::erase_if(all, [&](const TrackedFrame& frame) { return stamps.contains(frame.timestamp_s); });
  for (const AnchoredPose& pose : poses) all.emplace_back(pose, false);
  std::stable_sort(all.begin(), all.end(), [](const TrackedFrame& a, const TrackedFrame& b) {
    return a.timestamp_s < b.timestamp_s;
  });
  frames_.Assign(all);
}

void TrackedFrames::Refine(std::span<const AnchoredPose> poses) {
  std::map<double, AnchoredPose> by_stamp;
  for (const AnchoredPose& pose : poses) by_stamp.emplace(pose.timestamp_s, pose);
  std::vector<TrackedFrame> all = All();
  for (TrackedFrame& frame : all) {
    const auto found = by_stamp.find(frame.timestamp_s);
    if (found != by_stamp.end()) frame = TrackedFrame(found->second, frame.is_live);
  }
  frames_.Assign(all);
}

std::vector<TrackedFrames::CutPiece> TrackedFrames::CutAtLeaps() {
  std::vector<CutPiece> cut;
  for (const PartId part : Parts()) {
    const Trajectory path = PathOf(part);
    const std::vector<size_t> pieces = CutAt(FindLeaps(Smoothed(path)), path);
    const auto most = static_cast<double>(std::count(pieces.begin(), pieces.end(), size_t{0}));
    if (most < kNearlyAll * static_cast<double>(path.size())) continue;
    const std::vector<CutPiece> own = Cut(part, path, pieces);
    cut.insert(cut.end(), own.begin(), own.end());
  }
  return cut;
}

std::vector<TrackedFrames::CutPiece> TrackedFrames::Cut(PartId part, const Trajectory& path,
                                                        std::span<const size_t> pieces) {
  const size_t count = *std::max_element(pieces.begin(), pieces.end()) + 1;
  if (count == 1) return {};
  const auto map = map_->Write();
  // Of the pose that is nearest in time; those of a map that was loaded have other stamps.
  std::vector<std::vector<KeyframeId>> keyframes(count);
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part) return;
    const auto next = std::lower_bound(
        path.begin(), path.end(), keyframe.timestamp_s(),
        [](const StampedPose& pose, double timestamp_s) { return pose.timestamp_s < timestamp_s; });
    const auto pose = static_cast<size_t>((next == path.end() ? std::prev(next) : next) - path.begin());
    keyframes[keyframe.frame_id().IsValid() ? pieces[pose] : 0].push_back(keyframe.id());
  });
  if (keyframes[0].empty()) return {};
  std::vector<size_t> of_part;
  for (size_t i = 0; i < frames_.size(); ++i) {
    if (map->PartOf(frames_[i].reference) == part) of_part.push_back(i);
  }
  std::vector<PartId> parts(count, part);
  std::vector<CutPiece> cut;
  for (size_t k = 1; k < count; ++k) {
    if (keyframes[k].empty()) continue;
    parts[k] = map->SplitPart(keyframes[k]);
    cut.push_back({parts[k], part});
  }
  std::vector<TrackedFrame> all = All();
  for (size_t i = 0; i < path.size(); ++i) {
    TrackedFrame& frame = all[of_part[i]];
    const size_t k = keyframes[pieces[i]].empty() ? 0 : pieces[i];
    if (map->PartOf(frame.reference) == parts[k]) continue;
    const auto away_s = [&](KeyframeId id) {
      return std::abs(map->keyframes().At(id).timestamp_s() - frame.timestamp_s);
    };
    const KeyframeId nearest =
        *std::min_element(keyframes[k].begin(), keyframes[k].end(),
                          [&](KeyframeId a, KeyframeId b) { return away_s(a) < away_s(b); });
    const Rigid3 cam_from_nearest = map->CamFromReference(nearest, path[i].world_from_cam.Inverse());
    frame = TrackedFrame({frame.timestamp_s, nearest, cam_from_nearest}, frame.is_live);
  }
  frames_.Assign(all);
  return cut;
}

bool TrackedFrames::IsWrong(const CutPiece& piece, std::span<const AnchoredPose> found) const {
  const std::optional<double> longest = LongestStep(PathOf(piece.cut_from));
  if (!longest.has_value()) return false;
  std::map<double, Eigen::Vector3d> in_piece;
  for (const StampedPose& pose : PathOf(piece.part))
    in_piece.emplace(pose.timestamp_s, pose.world_from_cam.translation);
  int elsewhere = 0, count = 0;
  const auto map = map_->Read();
  for (const AnchoredPose& pose : found) {
    const auto before = in_piece.find(pose.timestamp_s);
    if (before == in_piece.end() || map->PartOf(pose.reference) != piece.cut_from) continue;
    const Eigen::Vector3d now = CamFromWorld(*map, pose).Inverse().translation;
    ++count;
    elsewhere += (now - before->second).norm() > *longest;
  }
  return count >= kMinFound && 2 * elsewhere > count;
}

void TrackedFrames::Smooth(const std::function<bool()>& should_stop) {
  for (const PartId part : Parts()) {
    if (should_stop && should_stop()) return;
    const Trajectory smooth = Smoothed(PathOf(part));
    std::vector<AnchoredPose> poses;
    {
      const auto map = map_->Read();
      auto next = smooth.begin();
      for (const TrackedFrame& frame : frames_) {
        if (map->PartOf(frame.reference) != part) continue;
        poses.push_back({frame.timestamp_s, frame.reference,
                         map->CamFromReference(frame.reference, next->world_from_cam.Inverse())});
        ++next;
      }
    }
    Refine(poses);
  }
}

std::vector<AnchoredPose> TrackedFrames::Poses() const {
  std::vector<AnchoredPose> poses;
  for (const TrackedFrame& frame : frames_) poses.push_back(frame.Pose());
  return poses;
}

std::vector<PartId> TrackedFrames::Parts() const {
  const auto map = map_->Read();
  std::vector<PartId> parts = map->Parts();
  std::map<PartId, size_t> frames;
  for (const TrackedFrame& frame : frames_) ++frames[map->PartOf(frame.reference)];
  std::erase_if(parts, [&](PartId part) { return frames[part] == 0; });
  std::stable_sort(parts.begin(), parts.end(), [&](PartId a, PartId b) { return frames[a] > frames[b]; });
  return parts;
}

Trajectory TrackedFrames::PathOf(PartId part) const {
  Trajectory path;
  const auto map = map_->Read();
  for (const TrackedFrame& frame : frames_) {
    if (map->PartOf(frame.reference) != part) continue;
    path.push_back({frame.timestamp_s, CamFromWorld(*map, frame.Pose()).Inverse()});
  }
  return path;
}

size_t TrackedFrames::LiveCountOf(PartId part) const {
  const auto map = map_->Read();
  return static_cast<size_t>(std::count_if(frames_.begin(), frames_.end(), [&](const TrackedFrame& frame) {
    return frame.is_live && map->PartOf(frame.reference) == part;
  }));
}

}  // namespace dynamic_slam
