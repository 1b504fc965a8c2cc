#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "dynamic_slam/viewer/map_picture.h"
#include "dynamic_slam/viewer/recording.h"
#include "dynamic_slam/viewer/server.h"

namespace dynamic_slam {

struct LiveViewOptions {
  std::optional<ServerOptions> server;  // none: only a recording
  std::filesystem::path recording;      // empty: none
  std::string source;                   // name, for the page
};

// What browsers wish of a run.
struct RunWishes {
  bool saves_map = false, resets = false;
};

// Shows a run to browsers, and records it. What it costs tracking's thread is a copy of what is shown; all
// else is done in the server's thread.
class LiveView : private Show {
 public:
  // raw_camera, image: of the images that are shown. Throws InputError.
  LiveView(const LiveViewOptions& options, const Camera& raw_camera, const ImageOptions& image, RunMode mode);
  ~LiveView() override;

  std::string url() const { return server_.has_value() ? server_->url() : ""; }

  // To be called after each frame, by tracking's thread. In offline mode waits for a recording to be written;
  // in realtime mode for nothing: of frames that come too fast some are not shown.
  void Watch(const RunProgress& progress, const SlamSystem& system);

  // Waits while a browser has it paused, and `should_stop` does not say so; then what was wished since the
  // last call.
  RunWishes WaitForWishes(const std::function<bool()>& should_stop);

  // A line for the list of events; kind is "good", "bad" or "info".
  void Tell(const std::string& kind, const std::string& text);

  // Shows what was told since the last frame, when there is no new one yet.
  void ShowEvents();

  // The map and the path were forgotten.
  void WasReset();

  // Throws what ended the recording, a full disk for one; the view goes on.
  void CheckRecording() const;

  // The map as it became in the end. Waits a moment for browsers to have it.
  void Finish(const SlamSystem& system);

 private:
  struct Keypoint {
    uint16_t x, y, kind, zero;  // px of the prepared image
  };
  // What is shown of a frame.
  struct Picture {
    uint32_t frame = 0;
    uint32_t state = 0;
    double timestamp_s = 0;
    nlohmann::json facts;
    std::vector<Keypoint> keypoints;
    cv::Mat raw;
    std::optional<MapPicture> map;
    std::vector<Message> events;
  };

  std::vector<Message> Backlog() override;
  void OnCommand(std::string_view command) override;
  void OnNobodyWatches() override { OnCommand("resume"); }  // nobody is left to do it

  // Of tracking's thread.
  nlohmann::json FactsOf(const RunProgress& progress, const SlamSystem& system);
  void NoteEvents(const RunProgress& progress, const SlamSystem& system);
  void AddEvent(nlohmann::json event);
  void FollowPath(const RunProgress& progress);
  std::optional<MapPicture> MapIfDue(const SharedMap& map, bool at_once);
  void Send(Picture picture, bool must_arrive);
  // The last frame again, with the events since and maybe another map.
  void SendAgain(std::optional<MapPicture> map);

  // Of the server's thread, or, without one, of tracking's.
  void Take(Picture picture);
  void TakeSafely(Picture picture);
  void Emit(const Message& message);
  Message FrameMessage();
  Message Player();

  RunMode mode_;
  nlohmann::json hello_;
  std::optional<RecordingWriter> recording_;

  // Of tracking's thread.
  std::vector<PathFrame> path_;
  uint32_t frame_ = 0, stretch_ = 0;
  double timestamp_s_ = 0;
  TrackingState state_ = TrackingState::kInitialising;
  bool was_tracking_ = false;
  size_t attempts_told_ = 0;
  std::string detector_failure_;
  double mapping_ms_ = 0, loop_ms_ = 0, detector_ms_ = 0;
  size_t keyframes_ = 0, landmarks_ = 0;
  std::chrono::steady_clock::time_point next_map_;
  std::vector<Message> events_;

  // Of the server's thread.
  ImagePreparer preparer_;
  Picture shown_;
  MapPicture map_;
  std::deque<Message> told_events_;
  uint32_t frames_since_whole_map_;

  std::atomic<int> on_the_way_ = 0;  // pictures that the server has not taken yet
  mutable Mutex mutex_;
  CondVar changed_;
  bool is_paused_ DS_GUARDED_BY(mutex_) = false;
  bool steps_ DS_GUARDED_BY(mutex_) = false;
  RunWishes wishes_ DS_GUARDED_BY(mutex_);
  std::exception_ptr failure_ DS_GUARDED_BY(mutex_);  // of the recording
  std::optional<ViewerServer> server_;                // last: its thread uses all the others
};

}  // namespace dynamic_slam
