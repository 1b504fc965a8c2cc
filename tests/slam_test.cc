// The whole SLAM in a rendered room with exact truth.

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/base/text.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

Room MakeRoom(int frames, uint64_t seed = 1) {
  RoomOptions options;
  options.frames = frames;
  options.seed = seed;
  return Room(options);
}

std::vector<cv::Mat> Frames(const Room& room, int begin, int end) {
  std::vector<cv::Mat> frames;
  for (int i = begin; i < end; ++i) frames.push_back(room.Frame(i));
  return frames;
}

std::vector<cv::Mat> BlackFrames(int count) {
  return std::vector<cv::Mat>(static_cast<size_t>(count), cv::Mat::zeros(480, 640, CV_8UC1));
}

std::vector<cv::Mat> Join(std::vector<cv::Mat> a, const std::vector<cv::Mat>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Each small tile is moved by up to so much, by chance: corners match, but no pose explains where they are.
cv::Mat Scattered(const cv::Mat& image, double most_px) {
  constexpr int kTile = 32, kReach = 8;
  Random random(7);
  cv::Mat padded, scattered = image.clone();
  cv::copyMakeBorder(image, padded, kReach, kReach, kReach, kReach, cv::BORDER_REFLECT);
  for (int y = 0; y < image.rows; y += kTile) {
    for (int x = 0; x < image.cols; x += kTile) {
      const auto width = static_cast<float>(std::min(kTile, image.cols - x));
      const auto height = static_cast<float>(std::min(kTile, image.rows - y));
      const auto dx = static_cast<float>(random.Uniform(-most_px, most_px));
      const auto dy = static_cast<float>(random.Uniform(-most_px, most_px));
      const cv::Point2f centre(static_cast<float>(x + kReach) + (width - 1) / 2 + dx,
                               static_cast<float>(y + kReach) + (height - 1) / 2 + dy);
      cv::Mat tile;
      cv::getRectSubPix(padded, cv::Size(static_cast<int>(width), static_cast<int>(height)), centre, tile);
      tile.copyTo(scattered(cv::Rect(x, y, tile.cols, tile.rows)));
    }
  }
  return scattered;
}

int CountState(const RunSummary& summary, TrackingState state) {
  return static_cast<int>(std::count_if(summary.frames.begin(), summary.frames.end(),
                                        [state](const auto& f) { return f.state == state; }));
}

class SystemTest : public FolderTest {};

class RoomTest : public ::testing::TestWithParam<uint64_t> {};

TEST_P(RoomTest, TheCameraIsFollowedThroughIt) {
  RoomOptions options;
  options.seed = GetParam();
  options.frames = 300;
  const Room room(options);
  const WholeRun run = RunAll(*MakeRoomSource(room), room.options().camera);
  const RunSummary& summary = run.summary;
  ASSERT_TRUE(summary.initialised_at.has_value()) << summary.last_reason;
  EXPECT_EQ(summary.frames_total, 300u);
  EXPECT_GE(summary.Coverage(), 0.97);
  EXPECT_EQ(summary.lost_count, 0);
  EXPECT_LE(ApeRmse(room.truth(), run.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
  EXPECT_THAT(run.system->map().Read()->Validate(), IsEmpty());
  EXPECT_EQ(run.system->KeyframeTrajectory().size(), summary.keyframes);
  EXPECT_EQ(summary.frames.size(), 300u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RoomTest, ::testing::Range<uint64_t>(1, 6));

TEST_F(SystemTest, AFisheyeIsFollowedThroughTheRoom) {
  RoomOptions options;
  options.frames = 150;
  options.camera.model = LensModel::kKannalaBrandt;
  options.camera.fx = options.camera.fy = 300;  // 60 deg at 311 px from the centre, 78 deg at the corners
  options.camera.k1 = -0.011;
  options.camera.k2 = 0.006;
  options.camera.k3 = -0.004;
  options.camera.k4 = 0.0009;
  const Room room(options);
  const WholeRun run = RunAll(*MakeRoomSource(room), options.camera);
  ASSERT_TRUE(run.summary.initialised_at.has_value()) << run.summary.last_reason;
  EXPECT_GE(run.summary.Coverage(), 0.95);
  EXPECT_EQ(run.summary.lost_count, 0);
  EXPECT_LE(ApeRmse(room.truth(), run.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
  double farthest_px = 0;
  run.system->map().Read()->keyframes().ForEach([&](const Keyframe& keyframe) {
    for (const Keypoint& keypoint : keyframe.features().keypoints) {
      farthest_px = std::max<double>(farthest_px, std::hypot(keypoint.raw_x - 320.1, keypoint.raw_y - 247.6));
    }
  });
  EXPECT_GT(farthest_px, 295);
  EXPECT_LT(farthest_px, 311.4 + 3);  // to a pixel of its octave
}

TEST_F(SystemTest, TwoRunsGiveTheSameBytes) {
  const std::vector<cv::Mat> frames = Frames(MakeRoom(90), 0, 90);
  for (const char* name : {"a", "b"}) {
    const WholeRun run = RunImages(frames);
    WriteResults(folder_ / name, *run.system, run.summary);
  }
  for (const char* name : {"trajectory.txt", "keyframes.txt", "map.ply", "config.yaml"}) {
    const std::string first = ReadFile(folder_ / "a" / name);
    EXPECT_GT(first.size(), 100u) << name;
    EXPECT_TRUE(first == ReadFile(folder_ / "b" / name)) << name << " differs";
  }
}

TEST_F(SystemTest, ACameraThatStandsStillNeverStarts) {
  const Room room = MakeRoom(1);
  const cv::Mat view = room.Render(room.truth()[0].world_from_cam);
  Random random(1);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 20; ++i) {
    frames.push_back(view.clone());
    for (auto pixel = frames.back().begin<uint8_t>(); pixel != frames.back().end<uint8_t>(); ++pixel) {
      *pixel = cv::saturate_cast<uint8_t>(*pixel + 1.5 * random.Gaussian());
    }
  }
  const WholeRun run = RunImages(std::move(frames));
  EXPECT_FALSE(run.summary.initialised_at.has_value());
  EXPECT_EQ(run.summary.frames_tracked, 0u);
  EXPECT_THAT(run.summary.last_reason, HasSubstr("parallax"));
}

TEST_F(SystemTest, BlackImagesGiveAReason) {
  const WholeRun run = RunImages(BlackFrames(3));
  EXPECT_EQ(run.summary.Coverage(), 0);
  EXPECT_THAT(run.summary.last_reason, HasSubstr("0 keypoints"));
  EXPECT_THAT(run.summary.last_reason, HasSubstr("texture"));
  WriteResults(folder_, *run.system, run.summary);  // empty results are results
  EXPECT_THAT(ReadFile(folder_ / "trajectory.txt"), testing::MatchesRegex("#[^\n]*\n"));
}

TEST_F(SystemTest, AfterImagesThatShowNothingItGoesOn) {
  const Room room = MakeRoom(125);
  const WholeRun run = RunImages(Join(Join(Frames(room, 0, 80), BlackFrames(3)), Frames(room, 83, 125)));
  const RunSummary& summary = run.summary;
  EXPECT_EQ(summary.lost_count, 1);
  for (size_t i = 80; i < 83; ++i) {
    EXPECT_EQ(summary.frames[i].state, TrackingState::kLost);
    EXPECT_THAT(summary.ReasonOf(i), HasSubstr("shows nothing"));
  }
  for (size_t i = 83; i < 125; ++i) {
    EXPECT_EQ(summary.frames[i].state, TrackingState::kTracking) << summary.ReasonOf(i);
    EXPECT_THAT(summary.ReasonOf(i), IsEmpty()) << "it was not looked for";
  }
  EXPECT_LE(ApeRmse(room.truth(), run.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
}

TEST_F(SystemTest, WhatFitsNoBetterThanChanceIsNoPose) {
  const Room room = MakeRoom(90);
  std::vector<cv::Mat> images = Frames(room, 0, 90);
  images[80] = Scattered(images[80], 4);
  SystemOptions options;
  options.orb.levels = 1;  // all corners are equally exact
  const WholeRun run = RunImages(std::move(images), options);
  const RunSummary& summary = run.summary;
  EXPECT_EQ(summary.frames[79].state, TrackingState::kTracking);
  EXPECT_EQ(summary.frames[80].state, TrackingState::kLost);
  EXPECT_THAT(summary.ReasonOf(80), HasSubstr("can be right")) << "many were found";
  EXPECT_EQ(summary.frames[81].state, TrackingState::kTracking) << summary.ReasonOf(81);
  EXPECT_THAT(summary.ReasonOf(81), HasSubstr("found again"));
}

TEST_F(SystemTest, ALostCameraIsFoundAgainInItsMap) {
  const Room room = MakeRoom(125), other = MakeRoom(5, 2);
  SystemOptions options;
  options.tracker.restart_after_frames = 15;  // only looked for
  const WholeRun run =
      RunImages(Join(Join(Frames(room, 0, 80), Frames(other, 0, 5)), Frames(room, 85, 125)), options);
  const RunSummary& summary = run.summary;
  ASSERT_TRUE(summary.initialised_at.has_value());
  EXPECT_EQ(summary.lost_count, 1);
  EXPECT_EQ(summary.reset_count, 0) << "the map is kept";
  for (size_t i = 80; i < 85; ++i) {
    EXPECT_EQ(summary.frames[i].state, TrackingState::kLost);
    EXPECT_THAT(summary.ReasonOf(i), HasSubstr("lost"));
  }
  EXPECT_EQ(summary.frames[85].state, TrackingState::kTracking) << summary.ReasonOf(85);
  EXPECT_THAT(summary.ReasonOf(85), HasSubstr("found again"));
  EXPECT_EQ(summary.frames.back().state, TrackingState::kTracking);
  EXPECT_LE(ApeRmse(room.truth(), run.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
  EXPECT_THAT(run.system->map().Read()->Validate(), IsEmpty());
}

TEST_F(SystemTest, AFoundPlaceThatTheNextImageDoesNotConfirmIsWithdrawn) {
  const Room room = MakeRoom(125), other = MakeRoom(10, 2);
  const std::vector<cv::Mat> images =
      Join(Join(Join(Frames(room, 0, 80), Frames(other, 0, 5)), Frames(room, 85, 86)),
           Join(Frames(other, 5, 10), Frames(room, 91, 125)));
  for (const bool backfills : {false, true}) {
    SystemOptions options;
    options.backfill = backfills;
    options.tracker.restart_after_frames = 15;  // only looked for
    const WholeRun run = RunImages(images, options);
    const RunSummary& summary = run.summary;
    EXPECT_EQ(summary.frames[85].state, TrackingState::kTracking) << summary.ReasonOf(85);
    EXPECT_THAT(summary.ReasonOf(86), HasSubstr("withdrawn"));
    EXPECT_THAT(summary.ReasonOf(91), HasSubstr("found again"));
    EXPECT_EQ(summary.frames[92].state, TrackingState::kTracking) << summary.ReasonOf(92);
    EXPECT_EQ(summary.lost_count, 2);
    const auto has_pose_at = [](const Trajectory& trajectory, double timestamp_s) {
      return std::any_of(trajectory.begin(), trajectory.end(), [=](const StampedPose& pose) {
        return std::abs(pose.timestamp_s - timestamp_s) < 1e-6;
      });
    };
    const double withdrawn = summary.frames[85].timestamp_s, confirmed = summary.frames[91].timestamp_s;
    EXPECT_FALSE(has_pose_at(run.system->FrameTrajectory(), withdrawn));
    EXPECT_TRUE(has_pose_at(run.system->FrameTrajectory(), confirmed));
    EXPECT_FALSE(has_pose_at(run.system->KeyframeTrajectory(), withdrawn));
    EXPECT_FALSE(has_pose_at(run.system->KeyframeTrajectory(), confirmed)) << "it was not then";
  }
}

TEST_F(SystemTest, AFilmWithACutInOnePlaceLeapsAndStaysWhole) {
  const Room room = MakeRoom(120);
  const WholeRun run = RunImages(Join(Frames(room, 0, 120), Frames(room, 20, 50)));
  const RunSummary& summary = run.summary;
  EXPECT_EQ(summary.maps, 1u);
  EXPECT_EQ(summary.pieces_cut, 0) << "nothing stands wrong";
  ASSERT_EQ(summary.leaps.size(), 1u);
  EXPECT_NEAR(summary.leaps[0].from_s, summary.frames[119].timestamp_s, 0.2);
  const Trajectory path = run.system->FrameTrajectory();
  ASSERT_GE(path.size(), 148u);
  // Counted from the end, as the one at the cut may have none: where they were the first time.
  const auto at = [](auto pose) -> Eigen::Vector3d { return pose->world_from_cam.translation; };
  const double went = (at(path.begin() + 119) - at(path.begin() + 20)).norm();
  for (int frame = 25; frame < 50; ++frame)
    EXPECT_LT((at(path.end() - 50 + frame) - at(path.begin() + frame)).norm(), 0.02 * went) << frame;
}

TEST_F(SystemTest, LostForLongItStartsAnotherMapAndKeepsBoth) {
  const Room room = MakeRoom(150), other = MakeRoom(60, 2);
  const WholeRun run =
      RunImages(Join(Join(Frames(room, 0, 80), Frames(other, 0, 50)), Frames(room, 80, 150)));
  const RunSummary& summary = run.summary;
  EXPECT_EQ(summary.reset_count, 0);
  EXPECT_TRUE(std::any_of(summary.reasons.begin(), summary.reasons.end(), [](const auto& reason) {
    return reason.second.find("is kept") != std::string::npos;
  }));
  EXPECT_EQ(summary.frames[125].state, TrackingState::kTracking) << "in the other room";
  EXPECT_EQ(summary.frames.back().state, TrackingState::kTracking) << "in the first room again";
  const std::vector<PartId> parts = run.system->Parts();
  ASSERT_EQ(parts.size(), 2u) << "no false join";
  EXPECT_EQ(summary.maps, 2u);
  EXPECT_GE(run.system->FrameTrajectory().size(), 130u);
  EXPECT_GE(run.system->FrameTrajectory(parts[1]).size(), 10u);
  EXPECT_EQ(summary.frames_in_other_maps, run.system->FrameTrajectory(parts[1]).size());
  EXPECT_LE(summary.frames_tracked, run.system->FrameTrajectory().size()) << "of the main map";
  EXPECT_THAT(run.system->map().Read()->Validate(), IsEmpty());
  WriteResults(folder_, *run.system, summary);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "trajectory_2.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "trajectory_3.txt"));
}

TEST_F(SystemTest, WhereFramesOfOneMapFollowThoseOfAnotherTheyAreOne) {
  const Room room = MakeRoom(150), other = MakeRoom(3, 2);
  const std::vector<cv::Mat> images =
      Join(Join(Frames(room, 0, 80), Frames(other, 0, 3)), Frames(room, 83, 150));
  SystemOptions options;
  options.tracker.min_relocalisation_inliers = 1000;  // so that it is lost
  options.loop.min_inliers = 1000;
  options.orb.features = 400;
  // Nothing makes them one; a loop; the growth of one over the frames of the other.
  for (const auto& [loops, refines] :
       {std::pair(false, false), std::pair(true, true), std::pair(false, true)}) {
    options.loop.enabled = loops;
    options.refine_poses = refines;
    const WholeRun run = RunImages(images, options);
    EXPECT_EQ(run.summary.maps, refines ? 1u : 2u);
    EXPECT_EQ(run.summary.loops.joined, loops ? 1 : 0);
    const Trajectory path = run.system->FrameTrajectory();
    EXPECT_THAT(run.system->map().Read()->Validate(), IsEmpty());
    // All but those of the other room.
    EXPECT_TRUE(refines ? path.size() >= 147 : path.size() < 120) << path.size();
    EXPECT_LE(ApeRmse(room.truth(), path), 0.01 * PathLength(ToPoseList(room.truth())));
  }
}

TEST_F(SystemTest, ThePathIsSmootherThanItsPosesAndTheMapIsTheSame) {
  const Room room = MakeRoom(90);
  double jolts[2], errors[2];
  Trajectory keyframes[2];
  for (const bool is_smooth : {false, true}) {
    SystemOptions options;
    options.orb.features = 300;  // noisy
    options.smooth_path = is_smooth;
    const WholeRun run = RunImages(Frames(room, 0, 90), options);
    const Trajectory path = run.system->FrameTrajectory();
    double sum = 0;
    for (size_t i = 2; i < path.size(); ++i) {
      sum += (path[i].world_from_cam.translation - 2 * path[i - 1].world_from_cam.translation +
              path[i - 2].world_from_cam.translation)
                 .squaredNorm();
    }
    jolts[is_smooth] = std::sqrt(sum);
    errors[is_smooth] = ApeRmse(room.truth(), path);
    keyframes[is_smooth] = run.system->KeyframeTrajectory();
  }
  EXPECT_LT(jolts[1], 0.7 * jolts[0]);
  EXPECT_LT(errors[1], errors[0]);
  ASSERT_EQ(keyframes[0].size(), keyframes[1].size());
  for (size_t i = 0; i < keyframes[0].size(); ++i)
    EXPECT_EQ(keyframes[0][i].world_from_cam, keyframes[1][i].world_from_cam);
}

TEST_F(SystemTest, ASmallMapThatLostTheCameraIsGivenUp) {
  const Room room = MakeRoom(60);
  ImageSource source(Join(Join(Frames(room, 0, 12), BlackFrames(20)), Frames(room, 30, 60)));
  SystemOptions options;
  options.backfill = false;  // else they are found in the second map
  const WholeRun run = RunAll(source, DefaultRoomCamera(), options);
  const RunSummary& summary = run.summary;
  EXPECT_EQ(summary.reset_count, 1);
  const auto reset = std::find_if(summary.reasons.begin(), summary.reasons.end(), [](const auto& reason) {
    return reason.second.starts_with("starting again");
  });
  ASSERT_NE(reset, summary.reasons.end());
  EXPECT_EQ(summary.frames[reset->first].state, TrackingState::kInitialising);
  ASSERT_TRUE(summary.initialised_at.has_value());
  EXPECT_GT(*summary.initialised_at, 32u) << "of the second map";
  for (const StampedPose& pose : run.system->FrameTrajectory()) EXPECT_GT(pose.timestamp_s, 31.0 / 30);
  EXPECT_THAT(run.system->map().Read()->Validate(), IsEmpty());
}

TEST_F(SystemTest, NothingIsSeenUnderTheMask) {
  const Room room = MakeRoom(30);
  cv::Mat mask = cv::Mat::zeros(480, 640, CV_8UC1);
  mask(cv::Rect(320, 0, 320, 480)) = 255;
  SlamSystem system(room.options().camera, {});
  FrameResult result;
  for (int i = 0; i < 30; ++i) result = system.Process(room.truth()[i].timestamp_s, room.Frame(i), mask);
  EXPECT_EQ(result.tracking.state, TrackingState::kTracking) << result.tracking.reason;
  system.map().Read()->keyframes().ForEach([](const Keyframe& keyframe) {
    for (const Keypoint& keypoint : keyframe.features().keypoints) EXPECT_LT(keypoint.raw_x, 320);
  });
}

// Landmarks that were followed from frame to frame until their depth was known, in a view without movers too.
TEST_F(SystemTest, LandmarksOfSeedsAreAsRightAsOthers) {
  const Room room = MakeRoom(200);
  SystemOptions options;
  const WholeRun without = RunAll(*MakeRoomSource(room), room.options().camera, options);
  options.tracker.seeds_min_share = 0;
  const WholeRun with = RunAll(*MakeRoomSource(room), room.options().camera, options);
  EXPECT_LT(with.summary.mapping.landmarks_created, without.summary.mapping.landmarks_created)
      << "nothing was left to triangulate of some keypoints";
  EXPECT_GE(with.summary.Coverage(), without.summary.Coverage());
  EXPECT_LE(ApeRmse(room.truth(), with.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
  EXPECT_THAT(with.system->map().Read()->Validate(), IsEmpty());
}

TEST_F(SystemTest, MoreKeypointsNeedMoreInliers) {
  const Room room = MakeRoom(1);
  const auto needed = [&](int features, const cv::Mat& image) {
    SystemOptions options;
    options.orb.features = features;
    SlamSystem system(room.options().camera, options);
    return system.Process(0, image).tracking.min_inliers;
  };
  const int usual = SystemOptions().tracker.min_inliers;
  EXPECT_EQ(needed(500, room.Frame(0)), usual);
  EXPECT_EQ(needed(1000, room.Frame(0)), usual);
  EXPECT_EQ(needed(2000, room.Frame(0)), 2 * usual);
  EXPECT_EQ(needed(2000, cv::Mat::zeros(480, 640, CV_8UC1)), usual) << "they were wanted, but are not there";
}

TEST_F(SystemTest, AnInterruptedRunKeepsWhatItHas) {
  const Room room = MakeRoom(200);
  SlamSystem system(room.options().camera, {});
  size_t frames = 0;
  const RunSummary summary = RunSequence(
      *MakeRoomSource(room), system,
      {[&](const RunProgress& progress) { frames = progress.frame; }, [&] { return frames == 30; }});
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(summary.frames_total, 30u);
  EXPECT_EQ(CountState(summary, TrackingState::kTracking), static_cast<int>(summary.frames_tracked));
  EXPECT_EQ(system.FrameTrajectory().size(), summary.frames_tracked + summary.frames_backfilled);
  EXPECT_GT(summary.Coverage(), 0.5);
}

TEST_F(SystemTest, AnImageThatCannotBePreparedChangesNothing) {
  SlamSystem system(DefaultRoomCamera(), {});
  EXPECT_THAT(ErrorOf([&] { system.Process(0, cv::Mat::zeros(480, 641, CV_8UC1)); }), HasSubstr("641 x 480"));
  EXPECT_EQ(system.Process(0, cv::Mat::zeros(480, 640, CV_16UC3)).id, FrameId(0));
}

TEST_F(SystemTest, AnImageThatCannotBePreparedIsSkippedUnlessItIsTheFirst) {
  const Room room = MakeRoom(4);
  std::vector<cv::Mat> frames = Frames(room, 0, 4);
  cv::cvtColor(frames[2], frames[2], cv::COLOR_GRAY2BGR);
  SystemOptions options;
  options.image.bayer = "rggb";
  ImageSource source(frames);
  const WholeRun run = RunAll(source, DefaultRoomCamera(), options);
  EXPECT_EQ(run.summary.frames.size(), 3u);
  EXPECT_EQ(run.summary.frames_total, 4u);
  ASSERT_EQ(run.summary.skipped.size(), 1u);
  EXPECT_EQ(run.summary.skipped[0].name, "2");
  EXPECT_THAT(run.summary.skipped[0].reason, HasSubstr("image.bayer is rggb"));

  ImageSource colour(std::vector<cv::Mat>{frames[2]});
  EXPECT_THAT(FailureMessage(RunAll(colour, DefaultRoomCamera(), options).summary),
              HasSubstr("image.bayer is rggb"));
}

TEST_F(SystemTest, PreparedImagesGiveTheSamePath) {
  // Three quarters of the size, without a strip at the bottom, from 12 bits in 16.
  const Room room = MakeRoom(60);
  std::vector<cv::Mat> frames = Frames(room, 0, 60);
  for (cv::Mat& frame : frames) frame.convertTo(frame, CV_16U, 4095.0 / 255);
  SystemOptions options;
  options.image.crop_height = 440;
  options.image.resize_width = 480;
  options.image.white_level = 4095;
  ImageSource source(frames);
  const WholeRun run = RunAll(source, DefaultRoomCamera(), options);
  EXPECT_EQ(run.system->camera().width, 480);
  EXPECT_EQ(run.system->camera().height, 330);
  ASSERT_TRUE(run.summary.initialised_at.has_value()) << run.summary.last_reason;
  EXPECT_LE(ApeRmse(room.truth(), run.system->FrameTrajectory()),
            0.005 * PathLength(ToPoseList(room.truth())));
}

TEST_F(SystemTest, NothingIsSeenUnderTheMaskFile) {
  const Room room = MakeRoom(3);
  cv::Mat used(480, 640, CV_8UC1, cv::Scalar(255));
  used(cv::Rect(0, 240, 640, 240)) = 0;
  SystemOptions options;
  options.image.mask = (folder_ / "mask.png").string();
  ASSERT_TRUE(cv::imwrite(options.image.mask, used));
  SlamSystem system(room.options().camera, options), free(room.options().camera, {});
  cv::Mat right = cv::Mat::zeros(480, 640, CV_8UC1);
  right(cv::Rect(320, 0, 320, 480)) = 255;
  EXPECT_EQ(system.Process(0, room.Frame(0), right).tracking.keypoints,
            free.Process(0, room.Frame(0), right | (used == 0)).tracking.keypoints)
      << "both masks count";
}

TEST_F(SystemTest, OptionsAndCamerasOutOfRangeAreNamed) {
  SystemOptions options;
  options.tracker.min_inliers = 0;
  options.orb.levels = 99;
  const std::string error = ErrorOf([&] { SlamSystem system(DefaultRoomCamera(), options); });
  EXPECT_THAT(error, HasSubstr("tracker.min_inliers"));
  EXPECT_THAT(error, HasSubstr("orb.levels"));
  Camera camera = DefaultRoomCamera();
  camera.fx = 0;
  EXPECT_THAT(ErrorOf([&] { SlamSystem system(camera, {}); }), HasSubstr("fx"));
}

TEST(SummariseTimesTest, KnownAnswers) {
  EXPECT_EQ(SummariseTimes({}).max, 0);
  const TimeStatistics odd = SummariseTimes({3, 1, 8});
  EXPECT_EQ(odd.median, 3);
  EXPECT_EQ(odd.mean, 4);
  EXPECT_EQ(odd.p95, 8);
  EXPECT_EQ(odd.max, 8);
  std::vector<double> hundred;
  for (int i = 100; i > 0; --i) hundred.push_back(i);
  const TimeStatistics even = SummariseTimes(hundred);
  EXPECT_EQ(even.median, 50.5);
  EXPECT_EQ(even.p95, 95);
}

}  // namespace
}  // namespace dynamic_slam
