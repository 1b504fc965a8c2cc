#include "dynamic_slam/io/box_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class BoxFileTest : public testing::Test {
 protected:
  std::vector<BoxRecord> Read(const std::string& text) {
    WriteFileAtomically(file_, text);
    return ReadBoxFile(file_);
  }
  void ExpectError(const std::string& text, const std::string& place, const std::string& reason) {
    try {
      Read(text);
      ADD_FAILURE() << "no error for " << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(place));
      EXPECT_THAT(error.what(), HasSubstr(reason));
    }
  }
  const std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("box_file_") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
};

TEST_F(BoxFileTest, ReadsTruth) {
  const auto records = Read("timestamp,actor,x,y,w,h,visible\n1.5,1,10,20,30,40,0.25\n");
  ASSERT_THAT(records, SizeIs(1));
  EXPECT_EQ(records[0].timestamp_s, 1.5);
  EXPECT_EQ(records[0].class_name, "person");
  EXPECT_EQ(records[0].visible, 0.25);
  EXPECT_EQ(records[0].score, 1);
  EXPECT_EQ(records[0].box.x, 10);
  EXPECT_EQ(records[0].box.height, 40);
}

TEST_F(BoxFileTest, WritesWhatItReads) {
  const std::vector<BoxRecord> records = {{1305031452.79172, "dining table", 0.125, 1, {1.5, -2, 30.25, 4}},
                                          {1305031452.82, "person", 1, 1, {0, 0, 640, 480}},
                                          {1305031453, "class #3", 1, 1, {0, 0, 640, 480}}};
  WriteBoxFile(file_, records);
  const auto read = ReadBoxFile(file_);
  ASSERT_THAT(read, SizeIs(3));
  EXPECT_EQ(read[2].class_name, "class #3");
  EXPECT_EQ(read[0].class_name, "dining table");
  EXPECT_NEAR(read[0].timestamp_s, 1305031452.79172, 1e-6);
  EXPECT_EQ(read[0].score, 0.125);
  EXPECT_EQ(read[0].box.y, -2);
  EXPECT_EQ(read[0].box.width, 30.25);
  EXPECT_EQ(read[1].box.width, 640);
}

TEST_F(BoxFileTest, AFileWithoutRowsHasNoBoxes) {
  EXPECT_THAT(Read("# nobody\ntimestamp,class,score,x,y,w,h\n"), IsEmpty());
}

TEST_F(BoxFileTest, ErrorsNameTheLine) {
  const std::string header = "timestamp,class,score,x,y,w,h\n";
  ExpectError("", ".csv", "is empty");
  ExpectError("timestamp,x,y,w\n", ".csv:1", "no column is called 'h'");
  ExpectError("timestamp,x,y,w,h,x\n", ".csv:1", "two columns are called 'x'");
  ExpectError(header + "1,person,0.5,1,2,3\n", ".csv:2", "6 columns, the header has 7");
  ExpectError(header + "1,person,0.5,1,2,3,4\n1,person,0.5,one,2,3,4\n", ".csv:3", "'one' is not a number");
  ExpectError(header + "1,person,0.5,1,nan,3,4\n", ".csv:2", "'nan' is not a number");
  ExpectError(header + "1,person,1.5,1,2,3,4\n", ".csv:2", "'1.5' is not between 0 and 1");
  ExpectError(header + "1,person,0.5,1,2,-3,4\n", ".csv:2", "'-3' is not between 0");
  ExpectError(header + "1,,0.5,1,2,3,4\n", ".csv:2", "the class is empty");
}

TEST_F(BoxFileTest, AMissingFileIsAnInputError) { EXPECT_THROW(ReadBoxFile("no/such/file.csv"), InputError); }

}  // namespace
}  // namespace dynamic_slam
