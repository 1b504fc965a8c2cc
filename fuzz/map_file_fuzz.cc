// Map files: whatever the bytes are, they are refused with a reason, or a valid map that can be saved and
// read again. The input is what follows a header, which is made to fit it: the checksum guards nothing here.

#include <cstdio>
#include <cstdlib>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/map/map_file.h"

namespace {

[[noreturn]] void Fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace dynamic_slam;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    const SavedMap saved = DecodeMap(WithMapHeader(bytes), "input");
    const auto problems = saved.map.Validate();
    if (!problems.empty()) Fail("accepted, but " + problems.front());
    const std::string again = EncodeMap(saved.camera, saved.map);
    if (EncodeMap(saved.camera, DecodeMap(again, "input").map) != again) Fail("another map when saved again");
  } catch (const InputError& error) {
    if (std::string(error.what()).find("input: ") != 0) Fail("refused without the name of the file");
  }
  return 0;
}
