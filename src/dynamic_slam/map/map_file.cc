#include "dynamic_slam/map/map_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <zlib.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");
static_assert(sizeof(Keypoint) == 28 && std::is_trivially_copyable_v<Keypoint>);
static_assert(sizeof(Descriptor) == 32 && std::is_trivially_copyable_v<Descriptor>);

constexpr std::string_view kMagic = "DYNSLAM\x1a";
constexpr size_t kHeaderBytes = 24;

// The least that each takes in the file, so that counts can be checked before memory is asked for.
constexpr size_t kKeyframeBytes = 81, kLandmarkBytes = 40, kObservationBytes = 8;

// Memory that a map may take beside what the file itself holds, in times of the file's length. Of maps that
// are not made up, grids (keypoint_grid.h) take up to 16 times, at 4K with 250 keypoints, and covisibility
// less than one.
constexpr double kMaxGridShare = 64, kMaxCovisibilityShare = 4;

constexpr uint32_t kMaxOctaves = 32, kMaxSizePx = 65536, kMaxName = 256;
constexpr int kMaxCount = 1 << 30;
constexpr double kMaxLength = 1e12, kMaxUnit = 1e12, kMaxPx = 1e6;

// What moves is no landmark of the next visit.
bool IsAtRest(const Landmark& landmark) { return landmark.static_log_odds >= 0; }

class Writer {
 public:
  // The room that the whole is expected to take.
  explicit Writer(size_t bytes = 0) { bytes_.reserve(bytes); }

  template <class T>
  void Put(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  template <class T>
  void PutAll(const std::vector<T>& values) {
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  }
  void PutRaw(std::string_view bytes) { bytes_.append(bytes); }
  void PutText(std::string_view text) {
    Put(static_cast<uint32_t>(text.size()));
    PutRaw(text);
  }
  template <int kSize>
  void PutVector(const Eigen::Matrix<double, kSize, 1>& vector) {
    for (int i = 0; i < kSize; ++i) Put(vector[i]);
  }
  // Over what was put there before.
  void Replace(size_t at, std::string_view bytes) { bytes_.replace(at, bytes.size(), bytes); }
  const std::string& bytes() const { return bytes_; }
  std::string TakeBytes() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// What is wrong with the bytes; DecodeMap names the file.
struct Refusal {
  std::string reason;
};

#define DS_REFUSE_UNLESS(condition, ...)                       \
  do {                                                         \
    if (!(condition)) throw Refusal{fmt::format(__VA_ARGS__)}; \
  } while (false)

class Reader {
 public:
  explicit Reader(std::string_view bytes) : left_(bytes) {}

  template <class T>
  T Take() {
    T value;
    std::memcpy(&value, TakeBytes(sizeof(T)).data(), sizeof(T));
    return value;
  }
  template <class T>
  std::vector<T> TakeAll(size_t count) {
    DS_REFUSE_UNLESS(count <= left_.size() / sizeof(T), "it ends too early");
    std::vector<T> values(count);
    if (count > 0) std::memcpy(values.data(), TakeBytes(count * sizeof(T)).data(), count * sizeof(T));
    return values;
  }
  // A count of things that take at least `bytes_each`.
  uint32_t TakeCount(size_t bytes_each) {
    const uint32_t count = Take<uint32_t>();
    DS_REFUSE_UNLESS(count <= left_.size() / bytes_each, "it announces more than it holds");
    return count;
  }
  std::string_view TakeBytes(size_t count) {
    DS_REFUSE_UNLESS(count <= left_.size(), "it ends too early");
    const std::string_view taken = left_.substr(0, count);
    left_.remove_prefix(count);
    return taken;
  }
  double TakeFinite(double limit) {
    const double value = Take<double>();
    DS_REFUSE_UNLESS(std::abs(value) <= limit, "a number is not finite or too large");
    return value;
  }
  template <int kSize>
  Eigen::Matrix<double, kSize, 1> TakeVector(double limit) {
    Eigen::Matrix<double, kSize, 1> vector;
    for (int i = 0; i < kSize; ++i) vector[i] = TakeFinite(limit);
    return vector;
  }
  size_t left() const { return left_.size(); }

 private:
  std::string_view left_;
};

void PutCamera(const Camera& camera, Writer* out) {
  out->Put(static_cast<uint32_t>(camera.width));
  out->Put(static_cast<uint32_t>(camera.height));
  out->Put(static_cast<uint32_t>(camera.model == LensModel::kKannalaBrandt));
  for (const double number : {camera.fps, camera.fx, camera.fy, camera.cx, camera.cy, camera.k1, camera.k2,
                              camera.p1, camera.p2, camera.k3, camera.k4}) {
    out->Put(number);
  }
  out->PutText(camera.name.substr(0, kMaxName));
}

Camera TakeCamera(Reader* in) {
  Camera camera;
  const uint32_t width = in->Take<uint32_t>(), height = in->Take<uint32_t>(), model = in->Take<uint32_t>();
  DS_REFUSE_UNLESS(width <= kMaxSizePx && height <= kMaxSizePx, "its images have {} x {} px", width, height);
  DS_REFUSE_UNLESS(model <= 1, "lens model {} is not known", model);
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.model = model == 1 ? LensModel::kKannalaBrandt : LensModel::kRadialTangential;
  for (double* number : {&camera.fps, &camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.k1, &camera.k2,
                         &camera.p1, &camera.p2, &camera.k3, &camera.k4}) {
    *number = in->Take<double>();
  }
  const uint32_t name = in->TakeCount(1);
  DS_REFUSE_UNLESS(name <= kMaxName, "the camera's name has {} letters", name);
  camera.name = in->TakeBytes(name);
  try {
    camera.Validate();
  } catch (const InputError& error) {
    throw Refusal{error.what()};
  }
  return camera;
}

void PutKeyframe(const Keyframe& keyframe, uint32_t part, Writer* out) {
  out->Put(keyframe.timestamp_s());
  out->PutVector<4>(keyframe.cam_from_world().rotation.coeffs());
  out->PutVector<3>(keyframe.cam_from_world().translation);
  out->Put(keyframe.unit());
  out->Put(part);
  out->Put(static_cast<uint32_t>(keyframe.features().size()));
  out->Put(static_cast<uint8_t>(!keyframe.static_probability().empty()));
  out->PutAll(keyframe.features().keypoints);
  out->PutAll(keyframe.features().descriptors);
  out->PutAll(keyframe.static_probability());
}

void TakeKeyframe(const std::array<double, 4>& bounds, Reader* in, Map* map, uint32_t* parts) {
  const double timestamp_s = in->TakeFinite(kMaxLength);
  Rigid3 cam_from_world;
  cam_from_world.rotation.coeffs() = in->TakeVector<4>(1.1);
  DS_REFUSE_UNLESS(std::abs(cam_from_world.rotation.norm() - 1) < 1e-6, "a rotation is none");
  cam_from_world.translation = in->TakeVector<3>(kMaxLength);
  const double unit = in->TakeFinite(kMaxUnit);
  DS_REFUSE_UNLESS(unit >= 1 / kMaxUnit, "a unit of length is not positive");
  const uint32_t part = in->Take<uint32_t>();
  DS_REFUSE_UNLESS(part <= *parts, "part {} comes before part {}", part, *parts);
  const uint32_t keypoints = in->Take<uint32_t>();
  const uint8_t has_static_probability = in->Take<uint8_t>();
  DS_REFUSE_UNLESS(has_static_probability <= 1, "a flag is neither 0 nor 1");
  FeatureSet features;
  features.keypoints = in->TakeAll<Keypoint>(keypoints);
  features.descriptors = in->TakeAll<Descriptor>(keypoints);
  for (const Keypoint& keypoint : features.keypoints) {
    for (const float px : {keypoint.x, keypoint.y, keypoint.raw_x, keypoint.raw_y}) {
      DS_REFUSE_UNLESS(std::abs(px) <= kMaxPx, "a keypoint is nowhere near the image");
    }
    DS_REFUSE_UNLESS(std::abs(keypoint.angle_rad) <= 4 && std::isfinite(keypoint.response),
                     "a keypoint's angle or response is out of range");
    DS_REFUSE_UNLESS(
        keypoint.octave >= 0 && static_cast<size_t>(keypoint.octave) < map->octave_scales().size(),
        "octave {} does not exist", keypoint.octave);
  }
  std::vector<float> static_probability = in->TakeAll<float>(has_static_probability != 0 ? keypoints : 0);
  for (const float probability : static_probability) {
    DS_REFUSE_UNLESS(probability >= 0 && probability <= 1, "a probability is not in 0 to 1");
  }
  KeypointGrid grid;
  grid.Build(features, bounds);
  if (part == *parts) {
    map->BeginPart();
    ++*parts;
  }
  map->AddKeyframe(FrameId(), timestamp_s, cam_from_world, std::move(features), std::move(grid),
                   std::move(static_probability), PartId(part))
      .Rescale(unit);
}

// keyframes: the index in the file of each id.
void PutLandmark(const Landmark& landmark, const std::vector<uint32_t>& keyframes, Writer* out) {
  out->PutVector<3>(landmark.position());
  out->Put(static_cast<uint32_t>(landmark.visible_count));
  out->Put(static_cast<uint32_t>(landmark.found_count));
  out->Put(landmark.static_log_odds);
  out->Put(static_cast<uint32_t>(landmark.observations().size()));
  for (const Observation& observation : landmark.observations()) {
    out->Put(keyframes[observation.keyframe.value()]);
    out->Put(observation.keypoint);
  }
}

// pairs: of keyframes that share a landmark, so far, each landmark's counted.
void TakeLandmark(double max_pairs, Reader* in, Map* map, double* pairs) {
  const Eigen::Vector3d position = in->TakeVector<3>(kMaxLength);
  const uint32_t visible = in->Take<uint32_t>(), found = in->Take<uint32_t>();
  DS_REFUSE_UNLESS(found <= visible && visible <= kMaxCount && visible > 0,
                   "a landmark was found {} times in {}", found, visible);
  const float static_log_odds = in->Take<float>();
  DS_REFUSE_UNLESS(static_log_odds >= 0 && static_log_odds <= kMaxStaticLogOdds,
                   "a landmark is not at rest by its evidence");
  const uint32_t count = in->TakeCount(kObservationBytes);
  DS_REFUSE_UNLESS(count >= 2, "a landmark has fewer than two observations");
  *pairs += static_cast<double>(count) * count;
  DS_REFUSE_UNLESS(*pairs <= max_pairs, "its keyframes share more landmarks than keyframes of its size can");
  std::vector<Observation> observations(count);
  for (uint32_t i = 0; i < count; ++i) {
    Observation& observation = observations[i];
    observation = {KeyframeId(in->Take<uint32_t>()), in->Take<uint32_t>()};
    const Keyframe* keyframe = map->keyframes().Find(observation.keyframe);
    DS_REFUSE_UNLESS(keyframe != nullptr && (i == 0 || observations[i - 1].keyframe < observation.keyframe),
                     "a landmark is seen by keyframe {}, which is not there or out of order",
                     observation.keyframe.value());
    DS_REFUSE_UNLESS(keyframe->part() == map->keyframes().At(observations[0].keyframe).part(),
                     "a landmark is seen in two parts of the map");
    DS_REFUSE_UNLESS(observation.keypoint < keyframe->landmarks().size() &&
                         !keyframe->landmarks()[observation.keypoint].IsValid(),
                     "keypoint {} of keyframe {} is not there, or shows two landmarks", observation.keypoint,
                     observation.keyframe.value());
  }
  Landmark& landmark = map->AddLandmark(position, observations.front().keyframe);
  landmark.visible_count = static_cast<int>(visible);
  landmark.found_count = static_cast<int>(found);
  landmark.static_log_odds = static_log_odds;
  landmark.is_from_file = true;
  map->LinkAll(landmark.id(), std::move(observations));
  map->RefreshLandmark(landmark.id());
}

SavedMap TakeMap(std::string_view payload) {
  Reader in(payload);
  const Camera camera = TakeCamera(&in);
  const std::vector<float> scales = in.TakeAll<float>(in.TakeCount(sizeof(float)));
  DS_REFUSE_UNLESS(!scales.empty() && scales.size() <= kMaxOctaves, "it has {} octaves", scales.size());
  for (size_t i = 0; i < scales.size(); ++i) {
    DS_REFUSE_UNLESS(scales[i] >= 1 && scales[i] <= 1e6f && (i == 0 || scales[i] > scales[i - 1]),
                     "the scales of its octaves do not grow");
  }
  SavedMap saved{camera, Map(scales)};
  const std::array<double, 4> bounds = camera.IdealBounds();
  const double width = bounds[2] - bounds[0], height = bounds[3] - bounds[1];
  DS_REFUSE_UNLESS(width < kMaxPx && height < kMaxPx, "its camera sees too much");
  const double grid_bytes = 2 * sizeof(uint32_t) * (width / KeypointGrid::kCellSizePx + 1) *
                            (height / KeypointGrid::kCellSizePx + 1);
  const double file_bytes = static_cast<double>(payload.size() + kHeaderBytes);

  const uint32_t keyframes = in.TakeCount(kKeyframeBytes);
  DS_REFUSE_UNLESS(keyframes * grid_bytes <= kMaxGridShare * file_bytes,
                   "{} keyframes with next to no keypoints", keyframes);
  uint32_t parts = 0;
  for (uint32_t i = 0; i < keyframes; ++i) TakeKeyframe(bounds, &in, &saved.map, &parts);
  const uint32_t landmarks = in.TakeCount(kLandmarkBytes);
  double pairs = 0;
  for (uint32_t i = 0; i < landmarks; ++i) {
    TakeLandmark(kMaxCovisibilityShare * file_bytes, &in, &saved.map, &pairs);
  }
  saved.map.CountCovisibility();
  DS_REFUSE_UNLESS(in.left() == 0, "{} bytes follow its end", in.left());
  return saved;
}

#undef DS_REFUSE_UNLESS

uint32_t Checksum(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::string Header(std::string_view payload) {
  Writer header;
  header.Put(kMapFileVersion);
  header.Put(Checksum(payload));
  header.Put(static_cast<uint64_t>(payload.size()));
  return std::string(kMagic) + header.bytes();
}

// Enough for the file of a map. It is large, so that a buffer that grows would need several times as much.
size_t RoomFor(const Map& map) {
  constexpr size_t kCameraBytes = kMaxName + 256;
  size_t bytes = kHeaderBytes + kCameraBytes + map.octave_scales().size() * sizeof(float);
  map.keyframes().ForEach([&bytes](const Keyframe& keyframe) {
    bytes += kKeyframeBytes + keyframe.features().size() * (sizeof(Keypoint) + sizeof(Descriptor)) +
             keyframe.static_probability().size() * sizeof(float);
  });
  map.landmarks().ForEach([&bytes](const Landmark& landmark) {
    bytes += kLandmarkBytes + landmark.observations().size() * kObservationBytes;
  });
  return bytes;
}

// Whether keypoints are where they would be with the other one.
bool IsSameCamera(const Camera& a, const Camera& b) {
  const auto numbers = [](const Camera& c) {
    return std::tuple(c.width, c.height, c.model, c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.k4);
  };
  return numbers(a) == numbers(b);
}

}  // namespace

std::string WithMapHeader(std::string_view payload) { return Header(payload).append(payload); }

std::string EncodeMap(const Camera& camera, const Map& map) {
  Writer out(RoomFor(map));
  out.PutRaw(std::string(kHeaderBytes, '\0'));
  PutCamera(camera, &out);
  out.Put(static_cast<uint32_t>(map.octave_scales().size()));
  out.PutAll(map.octave_scales());
  const std::vector<PartId> parts = map.Parts();
  std::vector<uint32_t> keyframe_index(map.keyframes().CreatedCount());
  out.Put(static_cast<uint32_t>(map.keyframes().size()));
  uint32_t keyframes = 0;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    keyframe_index[keyframe.id().value()] = keyframes++;
    const auto part = std::find(parts.begin(), parts.end(), keyframe.part());
    PutKeyframe(keyframe, static_cast<uint32_t>(part - parts.begin()), &out);
  });
  const auto for_each_at_rest = [&map](auto&& fn) {
    map.landmarks().ForEach([&fn](const Landmark& landmark) {
      if (IsAtRest(landmark)) fn(landmark);
    });
  };
  uint32_t landmarks = 0;
  for_each_at_rest([&landmarks](const Landmark&) { ++landmarks; });
  out.Put(landmarks);
  for_each_at_rest([&](const Landmark& landmark) { PutLandmark(landmark, keyframe_index, &out); });
  out.Replace(0, Header(std::string_view(out.bytes()).substr(kHeaderBytes)));
  return out.TakeBytes();
}

SavedMap DecodeMap(std::string_view bytes, const std::string& name) {
  const std::string save_again = "Save it again with run --save-map.";
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    throw InputError(name, "is no map file", "Give a file that run --save-map wrote.");
  }
  if (bytes.size() < kHeaderBytes) throw InputError(name, "is damaged: it ends too early", save_again);
  Reader header(bytes.substr(kMagic.size()));
  const uint32_t version = header.Take<uint32_t>(), checksum = header.Take<uint32_t>();
  const uint64_t size = header.Take<uint64_t>();
  if (version != kMapFileVersion) {
    throw InputError(
        name,
        fmt::format("is a map file of version {}, and this program reads version {}", version,
                    kMapFileVersion),
        version > kMapFileVersion ? "Use the program that wrote it, or a newer one." : save_again);
  }
  const std::string_view payload = bytes.substr(kHeaderBytes);
  if (size != payload.size()) {
    throw InputError(
        name,
        fmt::format("is damaged: it should have {} bytes after the header, and has {}", size, payload.size()),
        save_again);
  }
  if (Checksum(payload) != checksum) {
    throw InputError(name, "is damaged: the checksum is wrong", save_again);
  }
  try {
    return TakeMap(payload);
  } catch (const Refusal& refusal) {
    throw InputError(name, "is no valid map: " + refusal.reason, save_again);
  }
}

void WriteMapFile(const std::filesystem::path& file, const Camera& camera, const Map& map) {
  WriteFileAtomically(file, EncodeMap(camera, map));
}

SavedMap ReadMapFile(const std::filesystem::path& file) {
  return DecodeMap(ReadFile(file, "Give a file that run --save-map wrote."), file.string());
}

void CheckMapFits(const SavedMap& saved, const Camera& camera, const std::vector<float>& octave_scales,
                  const std::string& name) {
  if (!IsSameCamera(saved.camera, camera)) {
    throw InputError(name, fmt::format("was made with another camera ('{}')", saved.camera.name),
                     "Give the --camera and the options image.* of the run that saved it.");
  }
  if (saved.map.octave_scales() != octave_scales) {
    throw InputError(name, "was made with other octaves",
                     "Give orb.levels and orb.scale_factor of the run that saved it.");
  }
}

}  // namespace dynamic_slam
