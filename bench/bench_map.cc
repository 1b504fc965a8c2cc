#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

// A file of as many keyframes, in which half of the keypoints show landmarks, each of them in 25 keyframes.
std::string FileOf(int keyframes) {
  constexpr int kPoints = 1600, kSightings = 25;  // 1,000 points in the image
  SyntheticWorld world(kPoints);
  SyntheticMap scene(&world);
  for (int first = 0; first < keyframes; first += kSightings) {
    std::vector<KeyframeId> ids;
    for (int i = first; i < std::min(first + kSightings, keyframes); ++i) {
      ids.push_back(scene.Add(SidewaysPose(0.5 * i / keyframes)));
    }
    const auto half = static_cast<uint32_t>(first / kSightings % 2 * kPoints / 2);
    scene.AddLandmarks(half, half + kPoints / 2, ids);
  }
  return EncodeMap(world.camera(), scene.map);
}

void BM_DecodeMap(benchmark::State& state) {
  const std::string file = FileOf(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const SavedMap saved = DecodeMap(file, "map");
    benchmark::DoNotOptimize(saved.map.landmarks().size());
  }
  state.counters["MB"] = static_cast<double>(file.size()) / 1e6;
}
BENCHMARK(BM_DecodeMap)->Arg(500)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dynamic_slam
