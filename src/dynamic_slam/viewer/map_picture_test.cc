#include "dynamic_slam/viewer/map_picture.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

// The words of a message after its header.
std::vector<uint32_t> WordsOf(const Message& message) {
  std::vector<uint32_t> words((message->size() - kMessageHeaderBytes) / 4);
  std::memcpy(words.data(), message->data() + kMessageHeaderBytes, 4 * words.size());
  return words;
}

MapPicture SmallPicture() {
  return {{{1, 0, {0, 0, 0}}, {4, 0, {1, 1, 1}}, {6, 0, {2, 2, 2}}},
          {{0, 0, {0, 0, 0, 0, 0, 0, 1}, {}}, {2, 0, {1, 0, 0, 0, 0, 0, 1}, {0}}},
          {{{0, 0, 0}, 1, 0}, {{1, 0, 0}, 1, 0}},
          7};
}

TEST(MapPictureTest, NothingNewIsShort) {
  const MapPicture picture = SmallPicture();
  // No points, none gone, no keyframes, none gone; the whole path as it is, nothing after it; the part.
  EXPECT_EQ(WordsOf(MapMessage(picture, picture, 3, false)), (std::vector<uint32_t>{0, 0, 0, 0, 2, 0, 7}));
}

TEST(MapPictureTest, OnlyWhatChangedIsTold) {
  const MapPicture from = SmallPicture();
  MapPicture to = from;
  to.points[1].position[0] = 0;            // 4 moved
  to.points.erase(to.points.begin());      // 1 is gone
  to.points.push_back({9, 5, {0, 0, 0}});  // 9 is new, in another part
  to.cameras.pop_back();                   // 2 is gone
  to.path[1].stretch = 2;                  // from the second on
  const Message message = MapMessage(from, to, 3, false);
  const uint32_t one = std::bit_cast<uint32_t>(1.0f);
  EXPECT_EQ(WordsOf(message), (std::vector<uint32_t>{2, 4, 9, 0, one, one, 0,   0, 0, 0, 5, 1,
                                                     1, 0, 1, 2, 1,   1,   one, 0, 0, 2, 0, 7}));
  EXPECT_EQ(HeaderOf(*message).frame, 3u);
  EXPECT_EQ(HeaderOf(*message).detail, 0u);
}

TEST(MapPictureTest, WholeMapHasEverything) {
  const std::vector<uint32_t> words = WordsOf(MapMessage({}, SmallPicture(), 0, true));
  // 3 points, none gone, 2 keyframes of 10 words, one neighbour, none gone, a path of two, the part.
  EXPECT_EQ(words.size(), 1 + 3 * 5 + 1 + (1 + 2 * 10 + 1) + 1 + (2 + 2 * 5) + 1u);
}

}  // namespace
}  // namespace dynamic_slam
