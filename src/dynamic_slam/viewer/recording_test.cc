#include "dynamic_slam/viewer/recording.h"

#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

class RecordingTest : public FolderTest {};

Message Frame(uint32_t frame) { return MessageWriter({MessageType::kFrame, frame, 1}).Finish(); }

TEST_F(RecordingTest, IsReadAsItWasWritten) {
  const std::filesystem::path file = folder_ / kRecordingName;
  {
    RecordingWriter writer(file);
    writer.Add(0, JsonMessage(MessageType::kHello, 0, {{"source", "here"}}));
    for (uint32_t i = 0; i < 5; ++i) writer.Add(0.5 * i, Frame(i));
  }
  RecordingReader reader(file);
  ASSERT_EQ(reader.frames().size(), 5u);
  const RecordingReader::Entry& last = reader.entries()[reader.frames()[4]];
  EXPECT_EQ(last.header.frame, 4u);
  EXPECT_EQ(last.timestamp_s, 2.0);
  EXPECT_EQ(*reader.Read(reader.frames()[2]), *Frame(2));
}

TEST_F(RecordingTest, WhereverItEndsTheFramesBeforeAreThere) {
  const std::filesystem::path file = folder_ / kRecordingName;
  {
    RecordingWriter writer(file);
    writer.Add(0, JsonMessage(MessageType::kHello, 0, {}));
    for (uint32_t i = 0; i < 3; ++i) writer.Add(i, Frame(i));
  }
  size_t most = 3;
  for (auto bytes = static_cast<int64_t>(std::filesystem::file_size(file)); bytes >= 0; --bytes) {
    std::filesystem::resize_file(file, static_cast<uintmax_t>(bytes));
    size_t frames = 0;
    try {
      frames = RecordingReader(file).frames().size();
    } catch (const InputError&) {
    }
    EXPECT_LE(frames, most);
    most = frames;
  }
  EXPECT_EQ(most, 0u);
}

TEST_F(RecordingTest, AHelloThatIsNoneOrHasNoEndOfDepthsIsEmpty) {
  const auto hello_of = [this](const std::string& json) {
    const std::filesystem::path file = folder_ / kRecordingName;
    {
      RecordingWriter writer(file);
      MessageWriter hello({MessageType::kHello, 0, 0});
      hello.AddBytes(json);
      writer.Add(0, hello.Finish());
      writer.Add(0, Frame(0));
    }
    return RecordingReader(file).Hello();
  };
  EXPECT_EQ(hello_of(R"({"source": "here", "names": {"a": [1]}})").dump(),
            R"({"names":{"a":[1]},"source":"here"})");
  for (const char* json : {"", "[1]", "{", "1"}) EXPECT_EQ(hello_of(json), nlohmann::json::object()) << json;
  const std::string open(200'000, '['), close(200'000, ']');
  EXPECT_LT(hello_of(R"({"a": )" + open + close + "}").dump().size(), 100u);
}

}  // namespace
}  // namespace dynamic_slam
