#include "dynamic_slam/viewer/live_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/semantics/selective_tracking.h"

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kPicturesOnTheWay = 4;
constexpr auto kMapInterval = std::chrono::milliseconds(200);
constexpr int kMapShare = 30;  // the copy of the map takes at most this fraction of tracking's time
constexpr int kImageWidthPx = 640;
constexpr int kJpegQuality = 75;
constexpr size_t kEvents = 200;
constexpr uint32_t kWholeMapEvery =
    150;  // frames of a recording, so that seeking need not begin at the start

std::string EncodeJpeg(const cv::Mat& picture) {
  cv::Mat small = picture;
  if (picture.cols > kImageWidthPx) {
    const double scale = static_cast<double>(kImageWidthPx) / picture.cols;
    cv::resize(picture, small, {}, scale, scale, cv::INTER_AREA);
  }
  std::vector<uchar> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  return {bytes.begin(), bytes.end()};
}

double LastOf(const std::vector<double>& times_ms) { return times_ms.empty() ? 0 : times_ms.back(); }

uint16_t Pixel(float value) { return static_cast<uint16_t>(std::clamp(value, 0.0f, 65535.0f)); }

// As DrawFrame of report colours them.
uint16_t KindOf(const Frame& frame, size_t keypoint) {
  const bool is_trusted = frame.StaticProbability(keypoint) >= kMinStaticProbability;
  const bool has_landmark = keypoint < frame.landmarks.size() && frame.landmarks[keypoint].IsValid();
  if (has_landmark) return is_trusted ? 1 : 2;
  return is_trusted ? 0 : 3;
}

}  // namespace

LiveView::LiveView(const LiveViewOptions& options, const Camera& raw_camera, const ImageOptions& image,
                   RunMode mode)
    : mode_(mode), preparer_(raw_camera, image), frames_since_whole_map_(kWholeMapEvery) {
  const Camera& camera = preparer_.camera();
  hello_ = {{"mode", "live"},        {"run", Name(mode)},       {"source", options.source},
            {"width", camera.width}, {"height", camera.height}, {"fx", camera.fx},
            {"fy", camera.fy},       {"cx", camera.cx},         {"cy", camera.cy}};
  if (!options.recording.empty()) {
    recording_.emplace(options.recording);
    recording_->Add(0, JsonMessage(MessageType::kHello, 0, hello_));
  }
  if (options.server.has_value()) {
    server_.emplace(*options.server, static_cast<Show*>(this));
    server_->Start();
  }
}

LiveView::~LiveView() = default;

void LiveView::Watch(const RunProgress& progress, const SlamSystem& system) {
  frame_ = static_cast<uint32_t>(progress.frame - 1);
  timestamp_s_ = progress.image->timestamp_s;
  FollowPath(progress);
  NoteEvents(progress, system);
  const TrackingResult& tracking = progress.result->tracking;
  Picture picture;
  picture.map = MapIfDue(*progress.map, tracking.part_was_erased);
  if (picture.map.has_value()) {
    mapping_ms_ = LastOf(system.mapping_report().times_ms);
    loop_ms_ = LastOf(system.loop_report().times_ms);
  }
  picture.facts = FactsOf(progress, system);
  const Frame& frame = *progress.frame_in_work;
  picture.keypoints.reserve(frame.features.size());
  for (size_t i = 0; i < frame.features.size(); ++i) {
    const dynamic_slam::Keypoint& keypoint = frame.features.keypoints[i];
    picture.keypoints.push_back({Pixel(keypoint.raw_x), Pixel(keypoint.raw_y), KindOf(frame, i), 0});
  }
  picture.raw = progress.image->image;  // nobody writes to it any more
  Send(std::move(picture), mode_ == RunMode::kOffline);
}

nlohmann::json LiveView::FactsOf(const RunProgress& progress, const SlamSystem& system) {
  const FrameResult& result = *progress.result;
  const TrackingResult& tracking = result.tracking;
  nlohmann::json boxes = nlohmann::json::array();
  for (const DynamicBox& box : result.objects.boxes) {
    boxes.push_back({{"at", {box.box.x, box.box.y, box.box.width, box.box.height}},
                     {"name", progress.detector->class_names()[static_cast<size_t>(box.class_id)]},
                     {"score", box.score},
                     {"moves", box.is_dynamic},
                     {"detected", box.is_detected}});
  }
  nlohmann::json facts = {{"time", timestamp_s_},
                          {"total", progress.frames_total},
                          {"state", Name(tracking.state)},
                          {"reason", tracking.reason},
                          {"boxes", std::move(boxes)},
                          {"keypoints", tracking.keypoints},
                          {"inliers", tracking.inliers},
                          {"needed", tracking.min_inliers},
                          {"kept", tracking.dynamic.kept},
                          {"culled", tracking.dynamic.culled},
                          {"keyframes", keyframes_},
                          {"landmarks", landmarks_},
                          {"waiting", result.keyframes_waiting},
                          {"detection", Name(result.objects.state)},
                          {"detection_reason", result.objects.reason},
                          {"detector", system.detector() != nullptr ? system.detector()->name() : "none"},
                          {"ms",
                           {{"tracking", result.tracking_ms},
                            {"mapping", mapping_ms_},
                            {"loops", loop_ms_},
                            {"detector", detector_ms_}}}};
  if (tracking.state == TrackingState::kTracking) {
    facts["pose"] = WorldFromCam(progress.frame_in_work->cam_from_world);
  }
  return facts;
}

void LiveView::FollowPath(const RunProgress& progress) {
  const TrackingResult& tracking = progress.result->tracking;
  if (tracking.part_was_erased) {
    const auto map = progress.map->Read();
    std::erase_if(path_, [&](const PathFrame& f) { return !map->PartOf(f.pose.reference).IsValid(); });
  }
  const bool is_tracking = tracking.state == TrackingState::kTracking;
  if (is_tracking) {
    if (!was_tracking_) ++stretch_;
    for (const AnchoredPose& earlier : tracking.earlier_frames) path_.push_back({earlier, stretch_});
    const Frame& frame = *progress.frame_in_work;
    path_.push_back({{frame.timestamp_s, frame.reference, frame.cam_from_reference}, stretch_});
  }
  was_tracking_ = is_tracking;
}

std::optional<MapPicture> LiveView::MapIfDue(const SharedMap& map, bool at_once) {
  const Clock::time_point start = Clock::now();
  // Offline, the frames and not the clock say when, so that a recording of a fast run has as much of the map.
  const bool is_due = mode_ == RunMode::kOffline ? frame_ % 5 == 0 : start >= next_map_;
  if (!is_due && !at_once) return std::nullopt;
  MapPicture picture;
  {
    const auto now = map.Read();
    keyframes_ = now->keyframes().size();
    landmarks_ = now->landmarks().size();
    picture = PictureOf(*now, path_);
  }
  const Clock::time_point end = Clock::now();
  next_map_ = end + std::max<Clock::duration>(kMapInterval, kMapShare * (end - start));
  return picture;
}

void LiveView::AddEvent(nlohmann::json event) {
  event["time"] = timestamp_s_;
  event["frame"] = frame_;
  events_.push_back(JsonMessage(MessageType::kEvent, frame_, event));
}

void LiveView::Tell(const std::string& kind, const std::string& text) {
  AddEvent({{"kind", kind}, {"text", text}});
}

void LiveView::NoteEvents(const RunProgress& progress, const SlamSystem& system) {
  const TrackingResult& tracking = progress.result->tracking;
  if (tracking.part_was_erased) Tell("bad", "The map was given up: " + tracking.reason);
  if (tracking.state != state_) {
    if (tracking.state == TrackingState::kTracking) {
      Tell("good", state_ == TrackingState::kLost ? "Found again" : "Started: the camera has a pose");
    } else if (tracking.state == TrackingState::kLost) {
      Tell("bad", "Lost: " + tracking.reason);
    } else {
      Tell("info", "Looks for a new start: " + tracking.reason);
    }
    state_ = tracking.state;
  }
  if (progress.result->objects.reason != detector_failure_) {
    detector_failure_ = progress.result->objects.reason;
    if (!detector_failure_.empty()) Tell("bad", "The detector failed: " + detector_failure_);
  }
  // Reports grow with the run, and copying them is not for every frame.
  if (frame_ % 8 != 0) return;
  if (const auto detection = system.detection_report(); detection.has_value()) {
    detector_ms_ = LastOf(detection->times_ms);
  }
  const std::vector<LoopAttempt> attempts = system.loop_report().attempts;
  for (; attempts_told_ < attempts.size(); ++attempts_told_) {
    const LoopAttempt& attempt = attempts[attempts_told_];
    if (!attempt.reason.empty()) continue;
    AddEvent({{"kind", "loop"},
              {"text", fmt::format("Loop: the place of {:.1f} s ago is known again, {} landmarks",
                                   attempt.timestamp_s - attempt.candidate_timestamp_s, attempt.inliers)},
              {"keyframes", {attempt.keyframe.value(), attempt.candidate.value()}}});
  }
}

void LiveView::Send(Picture picture, bool must_arrive) {
  picture.frame = frame_;
  picture.state = static_cast<uint32_t>(state_);
  picture.timestamp_s = timestamp_s_;
  if (!server_.has_value()) {
    picture.events = std::exchange(events_, {});
    return TakeSafely(std::move(picture));
  }
  {
    MutexLock lock(mutex_);
    while (must_arrive && on_the_way_ >= kPicturesOnTheWay) changed_.Wait(mutex_);
  }
  if (on_the_way_ >= kPicturesOnTheWay) return;  // the next one takes the events along
  picture.events = std::exchange(events_, {});
  ++on_the_way_;
  server_->Post([this, picture = std::make_shared<Picture>(std::move(picture))] {
    TakeSafely(std::move(*picture));
    {
      MutexLock lock(mutex_);
      --on_the_way_;
    }
    changed_.NotifyAll();
  });
}

void LiveView::Take(Picture picture) {
  shown_ = std::move(picture);
  for (const Message& event : shown_.events) {
    told_events_.push_back(event);
    if (told_events_.size() > kEvents) told_events_.pop_front();
  }
  const bool is_watched = recording_.has_value() || (server_.has_value() && server_->HasBrowsers());
  if (shown_.map.has_value()) {
    if (is_watched) Emit(MapMessage(map_, *shown_.map, shown_.frame, false));
    map_ = std::move(*shown_.map);
    shown_.map.reset();
  }
  if (!is_watched) return;
  if (recording_.has_value() && ++frames_since_whole_map_ >= kWholeMapEvery) {
    frames_since_whole_map_ = 0;
    recording_->Add(shown_.timestamp_s, MapMessage({}, map_, shown_.frame, true));
  }
  for (const Message& event : shown_.events) Emit(event);
  Emit(FrameMessage());
}

void LiveView::Emit(const Message& message) {
  if (server_.has_value()) server_->Broadcast(message);
  if (recording_.has_value()) recording_->Add(shown_.timestamp_s, message);
}

void LiveView::TakeSafely(Picture picture) {
  try {
    Take(std::move(picture));
  } catch (...) {  // a full disk ends the recording, not the run
    recording_.reset();
    MutexLock lock(mutex_);
    failure_ = std::current_exception();
  }
}

Message LiveView::FrameMessage() {
  MessageWriter writer({MessageType::kFrame, shown_.frame, shown_.state});
  writer.AddJson(shown_.facts);
  writer.AddBytes({reinterpret_cast<const char*>(shown_.keypoints.data()),
                   shown_.keypoints.size() * sizeof(LiveView::Keypoint)});
  cv::Mat colour;
  if (!shown_.raw.empty()) preparer_.PrepareColour(shown_.raw, &colour);
  writer.AddBytes(colour.empty() ? "" : EncodeJpeg(colour));
  return writer.Finish();
}

Message LiveView::Player() {
  MutexLock lock(mutex_);
  return JsonMessage(MessageType::kPlayer, shown_.frame, {{"paused", is_paused_}});
}

std::vector<Message> LiveView::Backlog() {
  std::vector<Message> messages{JsonMessage(MessageType::kHello, shown_.frame, hello_)};
  messages.push_back(MapMessage({}, map_, shown_.frame, true));
  messages.insert(messages.end(), told_events_.begin(), told_events_.end());
  if (!shown_.facts.is_null()) messages.push_back(FrameMessage());
  messages.push_back(Player());
  return messages;
}

void LiveView::OnCommand(std::string_view command) {
  {
    MutexLock lock(mutex_);
    if (command == "pause") {
      is_paused_ = true;
    } else if (command == "resume") {
      is_paused_ = false;
    } else if (command == "step") {
      is_paused_ = steps_ = true;
    } else if (command == "save") {
      wishes_.saves_map = true;
    } else if (command == "reset") {
      wishes_.resets = true;
    } else {
      return;
    }
  }
  changed_.NotifyAll();
  server_->Broadcast(Player());
}

RunWishes LiveView::WaitForWishes(const std::function<bool()>& should_stop) {
  while (!should_stop()) {  // called without the lock, as it is the caller's
    MutexLock lock(mutex_);
    if (!is_paused_ || steps_ || wishes_.saves_map || wishes_.resets) {
      const bool has_wish = wishes_.saves_map || wishes_.resets;
      if (!has_wish) steps_ = false;
      return std::exchange(wishes_, {});
    }
    changed_.WaitUntil(mutex_, Clock::now() + std::chrono::milliseconds(100));
  }
  return {};
}

void LiveView::WasReset() {
  path_.clear();
  attempts_told_ = 0;
  state_ = TrackingState::kInitialising;
  was_tracking_ = false;
  keyframes_ = landmarks_ = 0;
  Tell("info", "Everything was forgotten, as was wished");
  Picture picture;
  picture.map.emplace();
  picture.facts = {{"time", timestamp_s_},
                   {"state", Name(state_)},
                   {"reason", "reset"},
                   {"boxes", nlohmann::json::array()}};
  Send(std::move(picture), true);
}

void LiveView::ShowEvents() { SendAgain(std::nullopt); }

void LiveView::SendAgain(std::optional<MapPicture> map) {
  auto change = [this, map = std::make_shared<std::optional<MapPicture>>(std::move(map)),
                 events = std::exchange(events_, {})] {
    Picture last = shown_;
    last.events = events;
    last.map = std::move(*map);
    TakeSafely(std::move(last));
  };
  if (server_.has_value()) {
    server_->Post(std::move(change));
  } else {
    change();
  }
}

void LiveView::CheckRecording() const {
  MutexLock lock(mutex_);
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void LiveView::Finish(const SlamSystem& system) {
  Tell("info", "The run has ended");
  std::optional<MapPicture> map;
  {
    const auto now = system.map().Read();
    map = PictureOf(*now, path_);
  }
  SendAgain(std::move(map));
  if (server_.has_value()) server_->Flush(std::chrono::milliseconds(1000));
}

}  // namespace dynamic_slam
