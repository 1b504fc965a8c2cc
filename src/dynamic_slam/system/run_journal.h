#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/system/run_results.h"

namespace dynamic_slam {

// A file beside the results to which each frame goes when it is done, so that a program that is killed takes
// no more along than the frame in work. Poses are those of the moment: what the map learned later is not in
// them.
class RunJournal {
 public:
  static constexpr const char* kFileName = "journal.csv";

  // A journal with frames that is there already, of a run that was killed, is kept under another name. Throws
  // InputError when the file cannot be written.
  explicit RunJournal(std::filesystem::path folder);

  // Where an older journal went; empty where there was none.
  const std::filesystem::path& kept() const { return kept_; }

  // reason: RunSummary::ReasonOf the frame. part, world_from_cam: of one that has. A disk that is full ends
  // the journal, not the run: false, once.
  bool Add(const RunSummary::FrameRecord& record, std::string_view reason, PartId part,
           const Rigid3& world_from_cam);

  // The results are written: nothing is left to recover.
  void Remove();

 private:
  std::filesystem::path file_, kept_;
  std::ofstream stream_;
};

struct RecoveredRun {
  size_t frames = 0;
  std::string frames_csv;
  std::vector<Trajectory> trajectories;  // of each part of the map, that with most frames first
};

// What a journal, or that in the folder of a run, tells. Its last line may be cut off. Throws InputError when
// there is none, or it is none.
RecoveredRun ReadJournal(const std::filesystem::path& folder_or_file);

}  // namespace dynamic_slam
