#include "dynamic_slam/map/map_file.h"

#include <csignal>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr size_t kHeaderBytes = 24;

// Two parts, with ids that have gaps.
struct TwoParts {
  TwoParts() : world(120), synthetic(&world) {
    Map& map = synthetic.map;
    const KeyframeId a = synthetic.Add(SidewaysPose(0)), gone = synthetic.Add(SidewaysPose(0.1)),
                     b = synthetic.Add({ExpSo3({0.02, -0.1, 0.05}), {-0.3, 0.1, 0.05}});
    synthetic.AddLandmarks(0, 80, {a, gone, b});
    const PartId second = map.BeginPart();
    const KeyframeId c = synthetic.Add(SidewaysPose(0.4), second),
                     d = synthetic.Add(SidewaysPose(0.8), second);
    synthetic.AddLandmarks(60, 120, {c, d});
    map.keyframes().At(d).Rescale(1.25);
    map.EraseKeyframe(gone, a);
    LandmarkId first;
    map.landmarks().ForEach([&](Landmark& landmark) {
      landmark.visible_count = 9;
      landmark.found_count = 7;
      landmark.static_log_odds = 0.5f;
      if (!first.IsValid()) first = landmark.id();
    });
    map.EraseLandmark(first);
    map.landmarks().ForEach([&](const Landmark& landmark) { map.RefreshLandmark(landmark.id()); });
  }
  const Map& map() const { return synthetic.map; }
  std::string Encode() const { return EncodeMap(world.camera(), map()); }

  SyntheticWorld world;
  SyntheticMap synthetic;
};

// What DecodeMap says; "" when it reads a valid map.
std::string Refusal(std::string_view bytes) {
  try {
    EXPECT_THAT(DecodeMap(bytes, "a.map").map.Validate(), IsEmpty());
    return "";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("a.map: "));
    return error.what();
  }
}

std::string PayloadOf(const std::string& bytes) { return bytes.substr(kHeaderBytes); }

// With other bytes at an offset of the payload, and a checksum that says they are right.
template <class T>
std::string Tampered(const std::string& bytes, size_t offset, const T& value) {
  std::string payload = PayloadOf(bytes);
  std::memcpy(payload.data() + offset, &value, sizeof(value));
  return WithMapHeader(payload);
}

class MapFileTest : public FolderTest {};

TEST_F(MapFileTest, WhatIsReadIsWhatWasWritten) {
  const TwoParts saved;
  WriteMapFile(folder_ / "a.map", saved.world.camera(), saved.map());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.map.tmp"));
  const SavedMap read = ReadMapFile(folder_ / "a.map");
  EXPECT_THAT(read.map.Validate(), IsEmpty());
  EXPECT_EQ(read.camera.fx, saved.world.camera().fx);
  EXPECT_EQ(read.camera.width, saved.world.camera().width);
  EXPECT_EQ(read.map.octave_scales(), saved.map().octave_scales());
  EXPECT_EQ(read.map.Parts().size(), 2u);
  EXPECT_EQ(EncodeMap(read.camera, read.map), saved.Encode());

  std::vector<const Keyframe*> before, after;
  saved.map().keyframes().ForEach([&](const Keyframe& keyframe) { before.push_back(&keyframe); });
  read.map.keyframes().ForEach([&](const Keyframe& keyframe) { after.push_back(&keyframe); });
  ASSERT_EQ(before.size(), after.size());
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i]->id().value(), i);
    EXPECT_FALSE(after[i]->frame_id().IsValid());
    EXPECT_EQ(after[i]->timestamp_s(), before[i]->timestamp_s());
    EXPECT_TRUE(after[i]->cam_from_world() == before[i]->cam_from_world());
    EXPECT_EQ(after[i]->unit(), before[i]->unit());
    EXPECT_EQ(after[i]->LandmarkCount(), before[i]->LandmarkCount());
    EXPECT_EQ(after[i]->features().descriptors, before[i]->features().descriptors);
    EXPECT_EQ(after[i]->grid().size(), before[i]->grid().size());
    EXPECT_EQ(read.map.places().WordsOf(after[i]->id()), saved.map().places().WordsOf(before[i]->id()));
  }
  std::vector<const Landmark*> points, points_read;
  saved.map().landmarks().ForEach([&](const Landmark& landmark) { points.push_back(&landmark); });
  read.map.landmarks().ForEach([&](const Landmark& landmark) { points_read.push_back(&landmark); });
  ASSERT_EQ(points.size(), points_read.size());
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points_read[i]->position(), points[i]->position());
    EXPECT_EQ(points_read[i]->found_count, 7);
    EXPECT_EQ(points_read[i]->visible_count, 9);
    EXPECT_EQ(points_read[i]->static_log_odds, 0.5f);
    EXPECT_EQ(points_read[i]->observations().size(), points[i]->observations().size());
    EXPECT_EQ(points_read[i]->descriptor(), points[i]->descriptor());
    EXPECT_EQ(points_read[i]->max_distance(), points[i]->max_distance());
  }
}

TEST_F(MapFileTest, APartThatWasSplitOffIsReadBack) {
  TwoParts two;
  two.synthetic.map.SplitPart({KeyframeId(0)});
  ASSERT_EQ(two.map().Parts().size(), 3u);
  const SavedMap read = DecodeMap(two.Encode(), "a.map");
  EXPECT_EQ(read.map.Parts().size(), 3u);
  EXPECT_THAT(read.map.Validate(), IsEmpty());
}

TEST_F(MapFileTest, WhatMovesIsNotSaved) {
  TwoParts saved;
  const size_t all = saved.map().landmarks().size();
  size_t moving = 0;
  saved.synthetic.map.landmarks().ForEach([&](Landmark& landmark) {
    if (landmark.id().value() % 3 != 0) return;
    landmark.static_log_odds = -0.1f;
    ++moving;
  });
  const Map read = DecodeMap(saved.Encode(), "a.map").map;
  EXPECT_GT(moving, 10u);
  EXPECT_EQ(read.landmarks().size(), all - moving);
  EXPECT_THAT(read.Validate(), IsEmpty());
}

TEST_F(MapFileTest, AnEmptyMapIsAMap) {
  const SyntheticWorld world(1);
  const SavedMap read = DecodeMap(EncodeMap(world.camera(), Map(SyntheticWorld::OctaveScales())), "a.map");
  EXPECT_EQ(read.map.keyframes().size(), 0u);
  EXPECT_THAT(read.map.Validate(), IsEmpty());
}

TEST_F(MapFileTest, TruncatedFilesAreRefused) {
  const std::string bytes = TwoParts().Encode();
  for (size_t percent = 0; percent < 100; ++percent) {
    EXPECT_THAT(Refusal(bytes.substr(0, bytes.size() * percent / 100)),
                testing::AnyOf(HasSubstr("is damaged"), HasSubstr("is no map file")))
        << percent;
  }
  EXPECT_THAT(Refusal(bytes + "x"), HasSubstr("bytes after the header"));
}

TEST_F(MapFileTest, FlippedBytesAreRefused) {
  const std::string bytes = TwoParts().Encode();
  Random random(3);
  for (int i = 0; i < 10000; ++i) {
    std::string flipped = bytes;
    flipped[random.Index(flipped.size())] ^= static_cast<char>(1 + random.Index(255));
    ASSERT_NE(Refusal(flipped), "");
  }
}

TEST_F(MapFileTest, LiesUnderARightChecksumAreRefusedOrAValidMap) {
  const std::string bytes = TwoParts().Encode();
  Random random(4);
  int refused = 0;
  for (int i = 0; i < 10000; ++i) {
    std::string payload = PayloadOf(bytes);
    // Half of them in the camera and the first keyframe's pose, where all but names and stamps matter.
    const size_t range = i % 2 == 0 ? 300 : payload.size();
    for (uint64_t flips = 1 + random.Index(3); flips > 0; --flips) {
      payload[random.Index(range)] ^= static_cast<char>(1 + random.Index(255));
    }
    if (i % 10 == 0) payload.resize(random.Index(payload.size()));
    refused += !Refusal(WithMapHeader(payload)).empty();
  }
  EXPECT_GT(refused, 3000);
}

TEST_F(MapFileTest, CountsThatCannotBeAreRefusedBeforeMemoryIsAskedFor) {
  const TwoParts saved;
  const std::string bytes = saved.Encode();
  const size_t name = 4 * 3 + 8 * 11;
  const size_t scales = name + 4 + saved.world.camera().name.size();
  const size_t keyframes = scales + 4 + 4 * SyntheticWorld::kOctaves;
  const size_t first_keypoints = keyframes + 4 + 8 * 9 + 4;
  for (const size_t count : {name, scales, keyframes, first_keypoints}) {
    EXPECT_THAT(Refusal(Tampered(bytes, count, 0xfffffff0u)),
                testing::AnyOf(HasSubstr("announces more than it holds"), HasSubstr("ends too early")))
        << count;
  }
  // Images of 4 gigapixels would need grids of that size.
  std::string wide = Tampered(bytes, 0, 65536u);
  wide = Tampered(wide, 4, 65536u);
  EXPECT_THAT(Refusal(wide), HasSubstr("next to no keypoints"));
}

TEST_F(MapFileTest, OtherVersionsAndOtherFilesAreRefusedWithTheReason) {
  std::string bytes = TwoParts().Encode();
  bytes[8] = 0;
  EXPECT_THAT(Refusal(bytes), testing::AllOf(HasSubstr("of version 0, and this program reads version 1"),
                                             HasSubstr("Save it again")));
  bytes[8] = 9;
  EXPECT_THAT(Refusal(bytes), testing::AllOf(HasSubstr("of version 9"), HasSubstr("a newer one")));
  EXPECT_THAT(Refusal("ply\nformat ascii 1.0\n"), HasSubstr("is no map file"));
  EXPECT_THAT(ErrorOf([&] { ReadMapFile(folder_ / "none.map"); }), HasSubstr("none.map: cannot be read"));
}

TEST_F(MapFileTest, KilledWhileSavingTheFileIsTheOldOneOrTheNewOne) {
  const std::filesystem::path file = folder_ / "a.map";
  TwoParts old_map;
  WriteMapFile(file, old_map.world.camera(), old_map.map());
  const std::string old_bytes = old_map.Encode();
  old_map.synthetic.map.landmarks().ForEach([](Landmark& landmark) { landmark.found_count = 3; });
  const std::string new_bytes = old_map.Encode();
  ASSERT_NE(old_bytes, new_bytes);
  Random random(5);
  int changed = 0;
  for (int i = 0; i < 50; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      while (true) {
        WriteFileAtomically(file, new_bytes);
        WriteFileAtomically(file, old_bytes);
      }
    }
    usleep(static_cast<useconds_t>(random.Index(20000)));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const std::string bytes = ReadFile(file);
    ASSERT_TRUE(bytes == old_bytes || bytes == new_bytes) << i;
    ASSERT_EQ(Refusal(bytes), "");
    changed += bytes == new_bytes;
  }
  EXPECT_GT(changed, 0) << "nothing was saved before the kill";
}

}  // namespace
}  // namespace dynamic_slam
