#include "dynamic_slam/system/tracked_frames.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "dynamic_slam/geometry/path_leaps.h"
#include "dynamic_slam/optimize/path_smoother.h"

namespace dynamic_slam {
namespace {

// With this share of its frames on one side of all leaps it is clear which side stands wrong: the other. With
// this share of them found elsewhere a piece can be done without.
constexpr double kNearlyAll = 0.75;

// By fewer poses that were found again nobody can tell whether a piece stands wrong: a few are found by
// chance, and where tracking was about to be lost it is wrong for a moment only.
constexpr size_t kMinFound = 5;
constexpr double kMinFoundShare = 0.25;

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

void TrackedFrames::Remove(const std::set<double>& stamps) {
  std::vector<TrackedFrame> left = All();
  std::erase_if(left, [&](const TrackedFrame& frame) { return stamps.contains(frame.timestamp_s); });
  frames_.Assign(left);
}

void TrackedFrames::RemoveThoseOfErasedParts() {
  const auto map = map_->Read();
  std::vector<TrackedFrame> left = All();
  std::erase_if(left, [&](const TrackedFrame& frame) { return !map->PartOf(frame.reference).IsValid(); });
  frames_.Assign(left);
}

void TrackedFrames::RemoveAllBut(std::span<const AnchoredPose> found, const Piece& piece) {
  std::set<double> stamps;
  for (const auto& [timestamp_s, centre] : piece.centres) stamps.insert(timestamp_s);
  for (const AnchoredPose& pose : found) stamps.erase(pose.timestamp_s);
  Remove(stamps);
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

void TrackedFrames::Replace(std::span<const AnchoredPose> poses) {
  std::map<double, AnchoredPose> by_stamp;
  for (const AnchoredPose& pose : poses) by_stamp.emplace(pose.timestamp_s, pose);
  std::vector<TrackedFrame> all = All();
  for (TrackedFrame& frame : all) {
    const auto found = by_stamp.find(frame.timestamp_s);
    if (found != by_stamp.end()) frame = TrackedFrame(found->second, frame.is_live);
  }
  frames_.Assign(all);
}

void TrackedFrames::Move(std::span<const FrameView> views) {
  std::map<double, const FrameView*> by_stamp;
  for (const FrameView& view : views) by_stamp.emplace(view.timestamp_s, &view);
  std::vector<TrackedFrame> all = All();
  {
    const auto map = map_->Read();
    for (TrackedFrame& frame : all) {
      const auto found = by_stamp.find(frame.timestamp_s);
      if (found == by_stamp.end() || map->PartOf(frame.reference) != found->second->part) continue;
      const Rigid3 moved = map->CamFromReference(frame.reference, found->second->cam_from_world);
      frame = TrackedFrame({frame.timestamp_s, frame.reference, moved}, frame.is_live);
    }
  }
  frames_.Assign(all);
}

bool TrackedFrames::Leaps() const {
  const std::vector<PartId> parts = Parts();
  return std::any_of(parts.begin(), parts.end(),
                     [this](PartId part) { return !FindLeaps(Smoothed(PathOf(part))).empty(); });
}

std::vector<TrackedFrames::Piece> TrackedFrames::PiecesAtLeaps() const {
  std::vector<Piece> pieces;
  for (const PartId part : Parts()) {
    const Trajectory path = PathOf(part);
    const std::vector<PathLeap> leaps = FindLeaps(Smoothed(path));
    if (leaps.empty()) continue;
    const std::vector<size_t> piece_of = CutAt(leaps, path);
    Trajectory rest;
    std::map<size_t, Piece> those;
    for (size_t i = 0; i < path.size(); ++i) {
      if (piece_of[i] == 0) {
        rest.push_back(path[i]);
      } else {
        those[piece_of[i]].centres.emplace(path[i].timestamp_s, path[i].world_from_cam.translation);
      }
    }
    const std::optional<double> longest_step = LongestStep(rest);
    const double share = static_cast<double>(rest.size()) / static_cast<double>(path.size());
    if (share < kNearlyAll || !longest_step.has_value()) continue;
    for (auto& [number, piece] : those) pieces.push_back({part, std::move(piece.centres), *longest_step});
  }
  return pieces;
}

std::vector<TrackedFrames::Piece> TrackedFrames::EndsAtLeaps(double within_s, bool is_before) const {
  std::vector<Piece> ends;
  for (const PartId part : Parts()) {
    const Trajectory path = PathOf(part);
    for (const PathLeap& leap : FindLeaps(Smoothed(path))) {
      Piece end{.part = part, .centres = {}, .is_end = true};
      for (const StampedPose& pose : path) {
        const double away_s = is_before ? leap.to_s - pose.timestamp_s : pose.timestamp_s - leap.from_s;
        if (away_s > 0 && away_s <= within_s)
          end.centres.emplace(pose.timestamp_s, pose.world_from_cam.translation);
      }
      if (!end.centres.empty()) ends.push_back(std::move(end));
    }
  }
  return ends;
}

std::vector<PartId> TrackedFrames::CutOff(std::span<const Piece> pieces) {
  std::vector<PartId> parts;
  for (const Piece& piece : pieces) {
    if (const PartId part = CutOff(piece); part.IsValid()) parts.push_back(part);
  }
  return parts;
}

PartId TrackedFrames::CutOff(const Piece& piece) {
  const double first_s = piece.centres.begin()->first, last_s = piece.centres.rbegin()->first;
  const auto is_inside = [&](double timestamp_s) { return first_s <= timestamp_s && timestamp_s <= last_s; };
  const auto map = map_->Write();
  std::vector<KeyframeId> inside, outside;
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != piece.part || !keyframe.frame_id().IsValid()) return;  // of this run
    (is_inside(keyframe.timestamp_s()) ? inside : outside).push_back(keyframe.id());
  });
  if (inside.empty() || outside.empty()) return {};
  std::vector<TrackedFrame> all = All();
  std::vector<std::pair<size_t, Rigid3>> of_part;  // where they are
  for (size_t i = 0; i < all.size(); ++i) {
    if (map->PartOf(all[i].reference) == piece.part)
      of_part.emplace_back(i, CamFromWorld(*map, all[i].Pose()));
  }
  const PartId own = map->SplitPart(inside);
  for (const auto& [i, cam_from_world] : of_part) {
    TrackedFrame& frame = all[i];
    const bool is_of_piece = piece.centres.contains(frame.timestamp_s);
    if (map->PartOf(frame.reference) == (is_of_piece ? own : piece.part)) continue;
    const std::vector<KeyframeId>& keyframes = is_of_piece ? inside : outside;
    const auto away_s = [&](KeyframeId id) {
      return std::abs(map->keyframes().At(id).timestamp_s() - frame.timestamp_s);
    };
    const KeyframeId nearest =
        *std::min_element(keyframes.begin(), keyframes.end(),
                          [&](KeyframeId a, KeyframeId b) { return away_s(a) < away_s(b); });
    frame = TrackedFrame({frame.timestamp_s, nearest, map->CamFromReference(nearest, cam_from_world)},
                         frame.is_live);
  }
  frames_.Assign(all);
  return own;
}

bool TrackedFrames::IsGuessed(const Piece& piece) const {
  for (const TrackedFrame& frame : frames_) {
    if (frame.is_live && piece.centres.contains(frame.timestamp_s)) return false;
  }
  bool has_keyframe = false;
  map_->Read()->keyframes().ForEach([&](const Keyframe& keyframe) {
    has_keyframe |= keyframe.part() == piece.part && keyframe.frame_id().IsValid() &&
                    piece.centres.contains(keyframe.timestamp_s());
  });
  return !has_keyframe;
}

bool TrackedFrames::IsWrong(const Piece& piece, std::span<const AnchoredPose> found) const {
  Trajectory now;
  {
    const auto map = map_->Read();
    for (const AnchoredPose& pose : found) {
      if (piece.centres.contains(pose.timestamp_s) && map->PartOf(pose.reference) == piece.part)
        now.push_back({pose.timestamp_s, CamFromWorld(*map, pose).Inverse()});
    }
  }
  return piece.is_end ? IsMended(piece, now) : IsElsewhere(piece, now);
}

bool TrackedFrames::HasNearlyAll(PartId part, const std::set<double>& stamps,
                                 std::span<const AnchoredPose> found) const {
  const auto map = map_->Read();
  const auto count = std::count_if(found.begin(), found.end(), [&](const AnchoredPose& pose) {
    return stamps.contains(pose.timestamp_s) && map->PartOf(pose.reference) == part;
  });
  return static_cast<double>(count) >= kNearlyAll * static_cast<double>(stamps.size());
}

bool TrackedFrames::IsElsewhere(const Piece& piece, const Trajectory& found) const {
  size_t elsewhere = 0;
  for (const StampedPose& pose : found) {
    const Eigen::Vector3d& before = piece.centres.at(pose.timestamp_s);
    elsewhere += (pose.world_from_cam.translation - before).norm() > piece.longest_step;
  }
  const double share = static_cast<double>(found.size()) / static_cast<double>(piece.centres.size());
  return found.size() >= kMinFound && share >= kMinFoundShare && 2 * elsewhere > found.size();
}

bool TrackedFrames::IsMended(const Piece& piece, const Trajectory& found) const {
  const double share = static_cast<double>(found.size()) / static_cast<double>(piece.centres.size());
  if (share < kNearlyAll) return false;
  Trajectory path = PathOf(piece.part);
  std::erase_if(path, [&](const StampedPose& pose) { return piece.centres.contains(pose.timestamp_s); });
  path.insert(path.end(), found.begin(), found.end());
  std::sort(path.begin(), path.end(),
            [](const StampedPose& a, const StampedPose& b) { return a.timestamp_s < b.timestamp_s; });
  const std::vector<PathLeap> leaps = FindLeaps(Smoothed(path));
  return std::none_of(leaps.begin(), leaps.end(), [&](const PathLeap& leap) {
    return leap.from_s <= piece.centres.rbegin()->first && leap.to_s >= piece.centres.begin()->first;
  });
}

void TrackedFrames::Smooth(const std::function<bool()>& should_stop) {
  for (const PartId part : Parts()) {
    if (should_stop && should_stop()) return;
    const Trajectory smooth = SmoothPathOf(part);
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
    Replace(poses);
  }
}

std::vector<AnchoredPose> TrackedFrames::Poses() const {
  std::vector<AnchoredPose> poses;
  for (const TrackedFrame& frame : frames_) poses.push_back(frame.Pose());
  return poses;
}

std::vector<AnchoredPose> TrackedFrames::PosesBut(const std::set<double>& stamps) const {
  std::vector<AnchoredPose> poses = Poses();
  std::erase_if(poses, [&stamps](const AnchoredPose& pose) { return stamps.contains(pose.timestamp_s); });
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

Trajectory TrackedFrames::PathOf(PartId part) const { return PathOf(part, false); }
Trajectory TrackedFrames::SmoothPathOf(PartId part) const { return Smoothed(PathOf(part)); }
Trajectory TrackedFrames::LivePathOf(PartId part) const { return PathOf(part, true); }

Trajectory TrackedFrames::PathOf(PartId part, bool only_live) const {
  Trajectory path;
  const auto map = map_->Read();
  for (const TrackedFrame& frame : frames_) {
    if (map->PartOf(frame.reference) != part || (only_live && !frame.is_live)) continue;
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
