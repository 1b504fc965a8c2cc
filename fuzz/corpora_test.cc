// The corpora of the fuzz targets, as they are, cut off and spoilt: no reader breaks its promises.

#include <algorithm>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/test_folder.h"
#include "readers.h"

namespace dynamic_slam {

void PrintTo(const Reader& reader, std::ostream* out) { *out << reader.name; }

namespace {

class CorporaTest : public FolderTest, public testing::WithParamInterface<Reader> {
 protected:
  void Read(const std::string& bytes, const std::string& what) {
    try {
      GetParam().read(bytes, folder_);
    } catch (const std::exception& error) {
      ADD_FAILURE() << what << ": " << error.what();
    }
  }
};

std::string Spoilt(std::string bytes, Random* random) {
  for (int i = 0; i < 3 && !bytes.empty(); ++i) {
    const size_t at = random->Index(static_cast<uint32_t>(bytes.size()));
    if (random->Index(2) == 0) {
      bytes[at] = static_cast<char>(random->Index(256));
    } else {
      bytes.erase(at, 1 + random->Index(8));
    }
  }
  return bytes;
}

TEST_P(CorporaTest, HoldsItsPromises) {
  const std::filesystem::path corpus = std::filesystem::path(FUZZ_CORPORA) / GetParam().name;
  std::vector<std::filesystem::path> files;
  for (const auto& item : std::filesystem::directory_iterator(corpus)) files.push_back(item.path());
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty()) << corpus;
  Random random(1);
  for (const std::filesystem::path& file : files) {
    const std::string bytes = ReadFile(file), name = file.filename().string();
    Read(bytes, name);
    for (size_t part = 0; part < 4; ++part)
      Read(bytes.substr(0, part * bytes.size() / 4), name + ", cut off");
    for (int i = 0; i < 10; ++i) Read(Spoilt(bytes, &random), name + ", spoilt");
  }
}

INSTANTIATE_TEST_SUITE_P(Readers, CorporaTest, testing::ValuesIn(Readers().begin(), Readers().end()),
                         [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace dynamic_slam
