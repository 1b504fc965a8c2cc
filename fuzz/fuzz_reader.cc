// fuzz_reader READER [options of libFuzzer] [FOLDER...]: looks for bytes under which a reader breaks its
// promises.

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <unistd.h>

#include "readers.h"

namespace {

const dynamic_slam::Reader* reader = nullptr;
std::filesystem::path folder;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  for (const dynamic_slam::Reader& known : dynamic_slam::Readers()) {
    if (*argc > 1 && std::strcmp((*argv)[1], known.name) == 0) reader = &known;
  }
  if (reader == nullptr) {
    std::fprintf(stderr, "Usage: fuzz_reader READER [options of libFuzzer] [FOLDER...]\nREADER is one of:");
    for (const dynamic_slam::Reader& known : dynamic_slam::Readers()) std::fprintf(stderr, " %s", known.name);
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  (*argv)[1] = (*argv)[0];
  ++*argv;
  --*argc;
  folder = std::filesystem::temp_directory_path() / ("dynamic_slam_fuzz_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::atexit([] { std::filesystem::remove_all(folder); });
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  reader->read({reinterpret_cast<const char*>(data), size}, folder);
  return 0;
}
