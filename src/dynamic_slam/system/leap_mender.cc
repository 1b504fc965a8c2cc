#include "dynamic_slam/system/leap_mender.h"

#include <algorithm>
#include <set>
#include <utility>

#include "dynamic_slam/tracking/backfiller.h"

namespace dynamic_slam {
namespace {

// So long before or after a leap tracking may have gone astray: the longest first, as the path comes back
// within a frame or two of which that would be mended alone.
constexpr double kEnds_s[] = {4.0 / 3, 2.0 / 3, 1.0 / 3, 1.0 / 6};

}  // namespace

int LeapMender::CutOffSides(const std::function<bool()>& should_stop) {
  std::vector<TrackedFrames::Piece> pieces = tracked_->PiecesAtLeaps();
  const size_t guessed = std::erase_if(pieces, [this](const TrackedFrames::Piece& piece) {
    if (!tracked_->IsGuessed(piece)) return false;
    tracked_->RemoveAllBut({}, piece);
    return true;
  });
  return static_cast<int>(guessed) + Mend(pieces, should_stop);
}

int LeapMender::MendEnds(const std::function<bool()>& should_stop) {
  int mended = 0;
  if (!tracked_->Leaps()) return mended;
  for (const double within_s : kEnds_s) {
    for (const bool is_before : {true, false}) {
      // Each alone, as they may overlap; the leap of one that was mended is gone.
      std::vector<TrackedFrames::Piece> ends = tracked_->EndsAtLeaps(within_s, is_before);
      size_t next = 0;
      for (size_t left = ends.size(); left > 0 && next < ends.size(); --left) {
        if (Mend({&ends[next], 1}, should_stop) > 0) {
          ++mended;
          ends = tracked_->EndsAtLeaps(within_s, is_before);
        } else {
          ++next;
        }
      }
    }
  }
  return mended;
}

int LeapMender::Mend(std::span<const TrackedFrames::Piece> pieces, const std::function<bool()>& should_stop) {
  if (pieces.empty() || (should_stop && should_stop())) return 0;
  std::set<double> stamps;
  for (const TrackedFrames::Piece& piece : pieces) {
    for (const auto& [timestamp_s, centre] : piece.centres) stamps.insert(timestamp_s);
  }
  // For a trial, as a film with a cut leaps too.
  Map map = *map_->Read();
  const std::vector<AnchoredPose> poses = tracked_->Poses();
  for (const PartId part : tracked_->CutOff(pieces)) map_->Write()->ErasePart(part);
  Backfiller backfiller(camera_, options_, seed_, map_);
  kept_.GiveTo(&backfiller, stamps);
  std::vector<AnchoredPose> found = backfiller.Find(tracked_->PosesBut(stamps), should_stop);
  const bool is_whole = !should_stop || !should_stop();
  std::vector<TrackedFrames::Piece> wrong;
  for (const TrackedFrames::Piece& piece : pieces) {
    if (is_whole && tracked_->IsWrong(piece, found)) wrong.push_back(piece);
  }
  map_->Write()->Replace(std::move(map));
  tracked_->Replace(poses);

  if (wrong.empty()) return 0;
  std::erase_if(found, [&](const AnchoredPose& pose) {
    return std::none_of(wrong.begin(), wrong.end(), [&](const TrackedFrames::Piece& piece) {
      return piece.centres.contains(pose.timestamp_s);
    });
  });
  const std::vector<PartId> parts = tracked_->CutOff(wrong);
  if (wrong.front().is_end) {
    tracked_->Replace(found);
    for (const TrackedFrames::Piece& piece : wrong) tracked_->RemoveAllBut(found, piece);
  } else {  // a whole side may be right in itself
    tracked_->AddFound(found);
  }
  const std::vector<PartId> with_frames = tracked_->Parts();
  for (const PartId part : parts) {
    if (std::find(with_frames.begin(), with_frames.end(), part) == with_frames.end())
      map_->Write()->ErasePart(part);
  }
  return static_cast<int>(wrong.size());
}

}  // namespace dynamic_slam
