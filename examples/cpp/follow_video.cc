// follow_video SOURCE CAMERA OUT: the camera's path through a video or a folder of images, and its map, into
// folder OUT.
#include <cstdio>
#include <exception>

#include <dynamic_slam/dynamic_slam.h>

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "usage: follow_video SOURCE CAMERA OUT\n");
    return 2;
  }
  const auto source = dynamic_slam::OpenFrameSource(argv[1]);
  dynamic_slam::Options options;
  options.detector = "builtin";
  dynamic_slam::System slam(dynamic_slam::LoadCamera(argv[2]), options);

  while (const auto image = source->Next()) {
    const auto result = slam.Process(image->timestamp_s, image->image);
    std::printf("%.3f s: %s, %d landmarks, %zu objects\n", result.timestamp_s,
                dynamic_slam::Name(result.state), result.inliers, result.objects.size());
  }
  slam.Finish();

  const std::filesystem::path out = argv[3];
  dynamic_slam::WriteTumTrajectory(out / "trajectory.txt", slam.Poses());
  slam.SaveMap(out / "map");
  std::printf("%zu poses and %zu parts of a map in %s\n", slam.Poses().size(), slam.Map().parts.size(),
              argv[3]);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
