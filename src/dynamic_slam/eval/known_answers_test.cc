// Results that evo gives for published trajectories; to be met to 1e-9.

#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

struct Answer {
  size_t n = 0;
  double rmse = 0, mean = 0, median = 0, std = kNotStated;
};

void ExpectRelative(double value, double expected, const char* what) {
  if (std::isnan(expected)) return;
  EXPECT_NEAR(value, expected, 1e-9 * expected) << what;
}

void ExpectAnswer(const ErrorStatistics& found, const Answer& answer) {
  EXPECT_EQ(found.n, answer.n);
  ExpectRelative(found.rmse, answer.rmse, "rmse");
  ExpectRelative(found.mean, answer.mean, "mean");
  ExpectRelative(found.median, answer.median, "median");
  ExpectRelative(found.std, answer.std, "std");
  ExpectRelative(found.sse, answer.rmse * answer.rmse * static_cast<double>(answer.n), "sse");
  EXPECT_LE(found.min, found.median);
  EXPECT_GE(found.max, found.mean);
}

class KnownAnswers : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("DYNAMIC_SLAM_DATA");
    if (data == nullptr) GTEST_SKIP() << "DYNAMIC_SLAM_DATA is not set: no trajectories to judge";
    folder_ = std::string(data) + "/trajectories/";
  }

  MatchedPoses Kitti(const std::string& estimate) const {
    return MatchByRow(ToPoseList(ReadKittiMatrices(folder_ + "KITTI_00_gt.txt"), {}),
                      ToPoseList(ReadKittiMatrices(folder_ + estimate), {}));
  }
  MatchedPoses Tum(const std::string& reference, const std::string& estimate) const {
    return MatchByTime(ToPoseList(ReadTumTrajectory(folder_ + reference)),
                       ToPoseList(ReadTumTrajectory(folder_ + estimate)), 0.01);
  }

  std::string folder_;
};

TEST_F(KnownAnswers, Kitti00OrbAbsolute) {
  const TrajectoryErrors errors = AbsolutePoseError(Kitti("KITTI_00_ORB.txt"), Alignment::kSe3);
  ExpectAnswer(errors.translation_m,
               {4541, 1.3034497145650266, 1.1569971285389768, 1.065624769555848, 0.6002822693968323});
  EXPECT_EQ(errors.reference_from_estimate.scale, 1.0);
}

TEST_F(KnownAnswers, Kitti00SptamAbsolute) {
  const TrajectoryErrors errors = AbsolutePoseError(Kitti("KITTI_00_SPTAM.txt"), Alignment::kSe3);
  ExpectAnswer(errors.translation_m, {4541, 3.738487907582613, 3.4909766330848684, 3.6425846417432637});
}

TEST_F(KnownAnswers, Kitti00OrbRelativeByFrame) {
  const TrajectoryErrors errors = RelativePoseError(Kitti("KITTI_00_ORB.txt"), Alignment::kNone, {});
  ExpectAnswer(errors.translation_m, {4540, 0.028120377017393464, 0.019301310981393552, 0.014709043438565866,
                                      0.020450305572286376});
  ExpectAnswer(errors.rotation_deg,
               {4540, 0.11497352089152525, 0.059583453985938666, 0.04107440667799087, 0.09832966244882327});
}

TEST_F(KnownAnswers, Kitti00OrbRelativeBy100Metres) {
  const TrajectoryErrors errors =
      RelativePoseError(Kitti("KITTI_00_ORB.txt"), Alignment::kNone, {100, DeltaUnit::kMetres});
  ExpectAnswer(errors.translation_m,
               {35, 1.1027416411758488, 1.000044679022125, 0.8951799347568006, 0.4647039564526429});
  ExpectAnswer(errors.rotation_deg,
               {35, 0.690937247531258, 0.595168811238703, 0.5078234410369651, 0.3509535099621885});
}

TEST_F(KnownAnswers, Fr2DeskKeyframes) {
  const MatchedPoses poses = Tum("fr2_desk_groundtruth.txt", "fr2_desk_ORB_kf_mono.txt");
  const TrajectoryErrors absolute = AbsolutePoseError(poses, Alignment::kSim3);
  ExpectRelative(absolute.reference_from_estimate.scale, 2.2280217535893287, "scale");
  ExpectAnswer(absolute.translation_m, {118, 0.007729264783424089, 0.007103615951625629,
                                        0.0070998222113337756, 0.0030463378840978475});
  const TrajectoryErrors relative = RelativePoseError(poses, Alignment::kSim3, {});
  ExpectAnswer(relative.translation_m, {117, 0.007069324681400399, 0.0056988261120830995,
                                        0.004931194320837508, 0.004183148622186004});
  ExpectAnswer(relative.rotation_deg,
               {117, 0.38709138324990994, 0.3376421803522741, 0.30395887175994046, 0.18930794234075615});
}

TEST_F(KnownAnswers, Fr1XyzKeyframes) {
  const MatchedPoses poses = Tum("freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-ORB_kf_mono.txt");
  const TrajectoryErrors absolute = AbsolutePoseError(poses, Alignment::kSim3);
  ExpectRelative(absolute.reference_from_estimate.scale, 1.1056223637370346, "scale");
  ExpectAnswer(absolute.translation_m,
               {32, 0.009754581898685104, 0.00821869858881662, 0.007909070259951205, 0.005254032881924017});
  const TrajectoryErrors relative = RelativePoseError(poses, Alignment::kSim3, {});
  ExpectAnswer(relative.translation_m,
               {31, 0.013834917845973996, 0.012058275165477084, 0.011141858767568104, 0.0067825475920548});
}

TEST_F(KnownAnswers, Fr2DeskAllFrames) {
  const MatchedPoses poses = Tum("fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt");
  const TrajectoryErrors absolute = AbsolutePoseError(poses, Alignment::kSim3);
  ExpectRelative(absolute.reference_from_estimate.scale, 0.9969698308032563, "scale");
  ExpectAnswer(absolute.translation_m, {2174, 0.006123163030157227, 0.005586197318706093,
                                        0.005305225075852543, 0.0025074937707529996});
  const TrajectoryErrors relative = RelativePoseError(poses, Alignment::kSim3, {});
  ExpectAnswer(relative.translation_m, {2173, 0.003485016890888194, 0.0030303829997873092,
                                        0.0027455208712606595, 0.0017210815217113004});
}

}  // namespace
}  // namespace dynamic_slam
