// map_file_seeds FOLDER: small maps, without their headers, for map_file_fuzz.

#include <cstdio>

#include "dynamic_slam/base/text.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/map/synthetic_world.h"

int main(int argc, char** argv) {
  using namespace dynamic_slam;
  if (argc != 2) {
    std::fprintf(stderr, "Usage: map_file_seeds FOLDER\n");
    return 2;
  }
  for (const int points : {0, 3, 12, 60}) {
    SyntheticWorld world(points);
    SyntheticMap synthetic(&world);
    std::vector<KeyframeId> keyframes;
    for (int i = 0; i < 3; ++i) keyframes.push_back(synthetic.Add(SidewaysPose(0.2 * i)));
    synthetic.AddLandmarks(0, static_cast<uint32_t>(points), keyframes);
    const PartId second = synthetic.map.BeginPart();
    synthetic.Add(SidewaysPose(1), second);
    const std::string file = EncodeMap(world.camera(), synthetic.map);
    WriteFileAtomically(std::filesystem::path(argv[1]) / ("map_" + std::to_string(points)),
                        file.substr(WithMapHeader("").size()));
  }
  return 0;
}
