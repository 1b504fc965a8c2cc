#include "dynamic_slam/io/point_cloud_file.h"

#include <cstring>
#include <vector>

#include <gmock/gmock.h>

#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using Colour = std::array<uint8_t, 3>;

class PointCloudFile : public FolderTest {};

const std::vector<Eigen::Vector3f> kPoints = {{1, 2, 3}, {-0.5F, 0.1F, 1e-7F}};
const std::vector<Colour> kColours = {{255, 0, 7}, {1, 2, 3}};

TEST_F(PointCloudFile, Ascii) {
  WritePly(folder_ / "a.ply", kPoints, kColours, PlyFormat::kAscii);
  EXPECT_EQ(ReadFile(folder_ / "a.ply"),
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
            "1 2 3 255 0 7\n-0.5 0.1 1e-07 1 2 3\n");
}

TEST_F(PointCloudFile, BinaryHoldsTheFloats) {
  for (const bool coloured : {false, true}) {
    WritePly(folder_ / "b.ply", kPoints, coloured ? kColours : std::vector<Colour>());
    const std::string bytes = ReadFile(folder_ / "b.ply");
    EXPECT_TRUE(bytes.starts_with("ply\nformat binary_little_endian 1.0\nelement vertex 2\n"));
    const std::string end = "end_header\n";
    const std::string data = bytes.substr(bytes.find(end) + end.size());
    const size_t stride = coloured ? 15 : 12;
    ASSERT_EQ(data.size(), 2 * stride);
    Eigen::Vector3f second;
    std::memcpy(second.data(), data.data() + stride, 12);
    EXPECT_EQ(second, kPoints[1]);
    if (coloured) {
      EXPECT_EQ(static_cast<uint8_t>(data[12]), 255);
    }
  }
}

TEST_F(PointCloudFile, EmptyCloudAndWrongCallAndBadFolder) {
  WritePly(folder_ / "c.ply", {});
  EXPECT_NE(ReadFile(folder_ / "c.ply").find("element vertex 0\n"), std::string::npos);
  EXPECT_THROW(WritePly(folder_ / "d.ply", kPoints, std::span(kColours).first(1)), InternalError);
  Write("file", "x");
  EXPECT_THROW(WritePly(folder_ / "file" / "e.ply", kPoints), InputError);
}

}  // namespace
}  // namespace dynamic_slam
