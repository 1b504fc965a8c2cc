#pragma once

#include <chrono>
#include <string>

#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

inline constexpr int kExitInterrupted = 130;

// Shows a run on the terminal: one line that is written over, a line for each change of state, and takes
// Ctrl-C as the wish to end the run with everything so far.
class RunConsole {
 public:
  explicit RunConsole(bool quiet);
  ~RunConsole();
  RunConsole(const RunConsole&) = delete;
  RunConsole& operator=(const RunConsole&) = delete;

  void Show(const RunProgress& progress);

  // A line that stays; from any thread.
  void Say(const std::string& text) const;

  // There was an interrupt.
  bool ShouldStop() const;

  // Both, for RunSequence.
  RunControl Control() {
    return {[this](const RunProgress& progress) { Show(progress); }, [this] { return ShouldStop(); }, {}};
  }

  // Ends the line.
  void End();

 private:
  bool quiet_;
  bool overwrite_;  // standard error is a terminal
  bool line_open_ = false;
  std::chrono::steady_clock::time_point start_, last_line_;
  TrackingState last_state_ = TrackingState::kInitialising;
};

// What came out.
void PrintSummary(const RunSummary& summary);

}  // namespace dynamic_slam
