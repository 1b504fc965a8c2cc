#pragma once

#include <filesystem>
#include <string>

#include "dynamic_slam/viewer/recording.h"
#include "dynamic_slam/viewer/server.h"

namespace dynamic_slam {

// Shows a recording to all browsers at once: whoever plays, steps or seeks does so for all of them.
class Replay : private Show {
 public:
  // Throws InputError.
  Replay(const std::filesystem::path& file, const ServerOptions& options);

  std::string url() const { return server_.url(); }
  size_t FrameCount() const { return recording_.frames().size(); }

 private:
  std::vector<Message> Backlog() override;
  void OnCommand(std::string_view text) override;

  Message Hello();
  Message Player() const;
  // Goes on to the next frame, and tells only what changed.
  void Advance();
  void SeekTo(size_t frame);
  // Shows the next frame when its time comes, unless something else was wished meanwhile.
  void PlayOn();

  RecordingReader recording_;
  size_t position_ = 0;  // among the frames
  bool is_playing_ = true;
  double speed_ = 1;
  unsigned turn_ = 0;    // counts wishes: a timer of before does nothing
  ViewerServer server_;  // last: its thread uses all the others
};

}  // namespace dynamic_slam
