#include "dynamic_slam/tracking/dynamic_filter.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/map/static_evidence.h"
#include "dynamic_slam/semantics/compensation_test_scene.h"
#include "dynamic_slam/tracking/witnesses.h"

namespace dynamic_slam {
namespace {

constexpr double kDepth = 3, kShift = 0.06;  // of the scene, and of the camera between the two frames

// A camera that moves to the right past a wall, and a person before it who walks along with the camera: a
// grid of keypoints, of which those in the box belong in turn to the person and to the wall behind.
class DynamicFilterTest : public ::testing::Test {
 protected:
  DynamicFilterTest() {
    const double wall_px = -camera_.fx * kShift / kDepth;  // 10 px to the left
    for (int row = 0; row < 22; ++row) {
      for (int col = 0; col < 30; ++col) {
        const double x = 30 + 20 * col, y = 20 + 20 * row;
        const bool on_person = Person(0).box.Contains(x, y) && (row + col) % 2 == 0;
        Add(x, y, x + (on_person ? kPersonPx : wall_px), y, on_person);
      }
    }
    frame_.timestamp_s = last_.timestamp_s + 1.0 / 30;
    last_.cam_from_world = Rigid3();
    frame_.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {-kShift, 0, 0});
    for (Frame* frame : {&last_, &frame_}) {
      frame->grid.Build(frame->features, camera_.IdealBounds());
      frame->ClearLandmarks();
    }
  }

  static DynamicBox Person(double shift_px) {
    DynamicBox box;
    box.box = {200 + shift_px, 100, 160, 300};
    box.track_id = 1;
    box.is_detected = true;
    box.probability = 0.95;
    box.is_dynamic = true;
    return box;
  }

  void Add(double x, double y, double next_x, double next_y, bool on_person) {
    const Descriptor descriptor{random_.Next(), random_.Next(), random_.Next(), random_.Next()};
    for (auto& [frame, px, py] : {std::tuple{&last_, x, y}, std::tuple{&frame_, next_x, next_y}}) {
      Keypoint keypoint;
      keypoint.x = keypoint.raw_x = static_cast<float>(px);
      keypoint.y = keypoint.raw_y = static_cast<float>(py);
      frame->features.keypoints.push_back(keypoint);
      frame->features.descriptors.push_back(descriptor);
    }
    on_person_.push_back(on_person);
  }

  DynamicFilter Make(const std::string& method) {
    DynamicOptions options;
    options.method = method;
    return DynamicFilter(camera_, options, OctaveScales());
  }

  // Both frames, the pose known after the second one.
  DynamicKeypoints Run(DynamicFilter* filter) { return Run(filter, Person(0), Person(kPersonPx)); }

  DynamicKeypoints Run(DynamicFilter* filter, const DynamicBox& before, const DynamicBox& now) {
    flow_.Clear(last_);
    filter->Judge(std::vector{before}, flow_, frame_, &last_);
    flow_.Match(last_, filter->Boxes(), {}, frame_);
    const DynamicKeypoints counts = filter->Judge(std::vector{now}, flow_, last_, &frame_);
    filter->Watch(flow_, last_, kDepth, &frame_);
    return counts;
  }

  // Something that moves by shift_px, as likely as not by its class.
  static DynamicBox Car(double x, double shift_px) {
    DynamicBox box = Person(0);
    box.box = {x + shift_px, 100, 160, 200};
    box.track_id = 2;
    box.probability = 0.6;
    return box;
  }

  bool IsInBox(size_t i) const {
    return Person(kPersonPx).box.Contains(frame_.features.keypoints[i].raw_x,
                                          frame_.features.keypoints[i].raw_y);
  }

  // Mean P(at rest) over the keypoints in the box that are, or are not, the person's.
  double MeanInBox(bool on_person) const {
    double sum = 0, count = 0;
    for (size_t i = 0; i < on_person_.size(); ++i) {
      if (!IsInBox(i) || on_person_[i] != on_person) continue;
      sum += frame_.static_probability[i];
      ++count;
    }
    return sum / count;
  }

  static std::vector<float> OctaveScales() { return {1.0f, 1.2f}; }
  static constexpr double kPersonPx = 8;

  Random random_{7};
  Camera camera_ = TestCamera();
  Frame last_, frame_;
  KeypointFlow flow_{camera_, OctaveScales()};
  std::vector<bool> on_person_;
};

TEST_F(DynamicFilterTest, ACarThatDoesNotMoveIsParked) {
  DynamicFilter filter = Make("weights");
  const double wall_px = -camera_.fx * kShift / kDepth;
  const DynamicKeypoints first = Run(&filter, Car(430, 0), Car(430, wall_px));
  EXPECT_GT(first.InBoxes(), 20) << "nobody knows yet";
  for (int i = 0; i < 3; ++i) Run(&filter, Car(430, 0), Car(430, wall_px));
  const DynamicKeypoints later = Run(&filter, Car(430, 0), Car(430, wall_px));
  EXPECT_EQ(later.InBoxes(), 0);
  EXPECT_FALSE(filter.IsHidden({500, 200}));
  EXPECT_EQ(filter.Boxes().size(), 1u) << "it is watched on";
}

TEST_F(DynamicFilterTest, AKeypointIsJudgedByTheBoxesThatItIsInAlone) {
  Random random(5);
  std::vector<DynamicBox> boxes;
  for (int k = 0; k < 24; ++k) {
    DynamicBox box = Person(0);
    box.box = {random.Uniform(0, 500), random.Uniform(0, 350), random.Uniform(50, 200),
               random.Uniform(50, 200)};
    box.track_id = k;
    boxes.push_back(box);
  }
  flow_.Clear(frame_);
  const auto judge = [&](const std::vector<DynamicBox>& of) {
    Frame frame = frame_;
    DynamicFilter filter = Make("weights");
    filter.Judge(of, flow_, last_, &frame);
    return frame.static_probability;
  };
  DynamicBox elsewhere = Person(0);
  elsewhere.box = {-900, -900, 10, 10};
  const float in_none = judge({elsewhere})[0];
  std::vector<int> in_boxes(frame_.features.size());
  for (const DynamicBox& box : boxes) {
    const std::vector<float> by_one = judge({box});
    for (size_t i = 0; i < by_one.size(); ++i) in_boxes[i] += by_one[i] != in_none;
  }
  // All are as likely to move, so that what counts is how many they are.
  const std::vector<float> by_all = judge(boxes);
  std::map<int, float> by_count{{0, in_none}};
  for (size_t i = 0; i < by_all.size(); ++i) {
    EXPECT_EQ(by_all[i], by_count.emplace(in_boxes[i], by_all[i]).first->second) << i;
  }
  EXPECT_GT(by_count.size(), 5u);
  EXPECT_GT(std::ranges::count(in_boxes, 0), 20);
  for (auto count = std::next(by_count.begin()); count != by_count.end(); ++count) {
    EXPECT_LE(count->second, std::prev(count)->second);
  }
}

TEST_F(DynamicFilterTest, ManyParkedCarsLeaveAPersonAMover) {
  DynamicBox car = Car(900, 0);  // out of view
  car.probability = 0.1;
  std::vector<DynamicBox> boxes(40, car);
  for (int k = 0; k < 40; ++k) boxes[k].track_id = 100 + k;
  boxes.push_back(Person(kPersonPx));
  DynamicFilter filter = Make("weights");
  flow_.Clear(frame_);
  filter.Judge(std::vector{Person(kPersonPx)}, flow_, last_, &frame_);
  const std::vector<float> alone = frame_.static_probability;
  EXPECT_GT(filter.Judge(boxes, flow_, last_, &frame_).culled, 50);
  EXPECT_EQ(frame_.static_probability, alone);
}

TEST_F(DynamicFilterTest, ACarThatDrivesCountsAsMovingForSure) {
  DynamicFilter filter = Make("weights");
  const DynamicKeypoints first = Run(&filter, Car(200, 0), Car(200, kPersonPx));
  EXPECT_GT(first.kept, 0) << "nobody knows yet";
  const DynamicKeypoints later = Run(&filter, Car(200, 0), Car(200, kPersonPx));
  EXPECT_GT(later.culled, 2 * later.kept);
}

TEST_F(DynamicFilterTest, APersonWhoStandsStillRemainsAPerson) {
  DynamicFilter filter = Make("weights");
  const double wall_px = -camera_.fx * kShift / kDepth;
  DynamicBox before = Car(430, 0), now = Car(430, wall_px);
  before.probability = now.probability = 1;
  DynamicKeypoints counts;
  for (int i = 0; i < 30; ++i) counts = Run(&filter, before, now);
  EXPECT_GT(counts.InBoxes(), 20);
  EXPECT_TRUE(filter.IsHidden({500, 200}));
}

TEST_F(DynamicFilterTest, WithoutParallaxACarTellsNothing) {
  DynamicFilter filter = Make("weights");
  frame_.cam_from_world = Rigid3();  // the camera stands still, and so does what is in the box
  for (size_t i = 0; i < frame_.features.size(); ++i) {
    frame_.features.keypoints[i].raw_x = frame_.features.keypoints[i].x = last_.features.keypoints[i].x;
  }
  frame_.grid.Build(frame_.features, camera_.IdealBounds());
  DynamicKeypoints counts;
  for (int i = 0; i < 5; ++i) counts = Run(&filter, Car(430, 0), Car(430, 0));
  EXPECT_GT(counts.InBoxes(), 20);
}

TEST_F(DynamicFilterTest, SaysWhenOnlyPeopleMove) {
  DynamicFilter filter = Make("weights");
  flow_.Clear(frame_);
  filter.Judge(std::vector{Person(0)}, flow_, last_, &frame_);
  const auto moved = [](double x, double shift_px) { return PointMotion{{x, 200}, {x + shift_px, 200}}; };
  std::vector<PointMotion> motions;
  for (int i = 0; i < 10; ++i) motions.push_back(moved(220 + 10 * i, i < 5 ? 6 : 0));  // in the box
  for (int i = 0; i < 10; ++i) motions.push_back(moved(400 + 10 * i, 0.3));
  EXPECT_TRUE(filter.OnlyBoxesMove(motions));
  for (PointMotion& motion : motions) motion.to_px.x() += 5;  // the camera turns
  EXPECT_FALSE(filter.OnlyBoxesMove(motions));
}

TEST_F(DynamicFilterTest, WithoutDynamicObjectsEverythingIsTrusted) {
  DynamicFilter filter = Make("weights");
  DynamicBox chair = Person(0);
  chair.is_dynamic = false;
  flow_.Clear(frame_);
  const DynamicKeypoints counts = filter.Judge(std::vector{chair}, flow_, last_, &frame_);
  EXPECT_EQ(counts.outside, static_cast<int>(frame_.features.size()));
  for (const float p : frame_.static_probability) EXPECT_EQ(p, 1);
  EXPECT_FALSE(filter.IsHidden({280, 250}));
}

TEST_F(DynamicFilterTest, HardBoxesTakeAllThatIsInThem) {
  DynamicFilter filter = Make("boxes");
  const DynamicKeypoints counts = Run(&filter);
  EXPECT_EQ(counts.kept, 0);
  EXPECT_GT(counts.culled, 50);
  for (size_t i = 0; i < on_person_.size(); ++i) EXPECT_EQ(frame_.static_probability[i], IsInBox(i) ? 0 : 1);
  EXPECT_TRUE(filter.IsHidden({280, 250}));
}

TEST_F(DynamicFilterTest, ResetForgetsTheBoxes) {
  DynamicFilter filter = Make("boxes");
  Run(&filter);
  EXPECT_TRUE(filter.HasBoxes());
  filter.Reset();
  EXPECT_FALSE(filter.HasBoxes());
  EXPECT_FALSE(filter.IsHidden({280, 250}));
}

TEST_F(DynamicFilterTest, NoneTrustsEverything) {
  DynamicFilter filter = Make("none");
  EXPECT_EQ(Run(&filter).InBoxes(), 0);
  for (const float p : frame_.static_probability) EXPECT_EQ(p, 1);
}

TEST_F(DynamicFilterTest, PaperKeepsWhatMovesAsItsSurroundings) {
  DynamicFilter filter = Make("paper");
  const DynamicKeypoints counts = Run(&filter);
  EXPECT_NEAR(MeanInBox(false), 1, 0.05);
  EXPECT_NEAR(MeanInBox(true), 0, 0.05);
  EXPECT_NEAR(counts.kept, counts.culled, 0.2 * counts.InBoxes());
}

TEST_F(DynamicFilterTest, MotionTellsThePersonFromTheWallBehind) {
  DynamicFilter filter = Make("weights");
  Run(&filter);
  EXPECT_GT(MeanInBox(false), kMinStaticProbability);
  EXPECT_LT(MeanInBox(true), 0.1);
  // Far from the box nothing is doubted much.
  EXPECT_GT(frame_.static_probability.front(), 0.9);
}

TEST_F(DynamicFilterTest, BeforeAPoseMotionTellsThePersonFromTheWallTooByWhatIsOutside) {
  DynamicFilter filter = Make("weights");
  flow_.Clear(last_);
  filter.Judge(std::vector{Person(0)}, flow_, frame_, &last_);
  flow_.Match(last_, filter.Boxes(), {}, frame_);
  filter.Judge(std::vector{Person(kPersonPx)}, flow_, last_, &frame_);
  filter.WatchBeforePose(flow_, last_, &frame_);
  EXPECT_GT(MeanInBox(false), kMinStaticProbability);
  EXPECT_LT(MeanInBox(true), 0.1);
}

TEST_F(DynamicFilterTest, WhoStandsStillBesideAnotherWhoWalksIsNotTakenForTheWall) {
  DynamicFilter filter = Make("weights");
  DynamicBox stands_before = Person(0), stands_now = Person(-camera_.fx * kShift / kDepth);
  stands_before.track_id = stands_now.track_id = 2;
  flow_.Clear(last_);
  filter.Judge(std::vector{Person(0), stands_before}, flow_, frame_, &last_);
  flow_.Match(last_, filter.Boxes(), {}, frame_);
  filter.Judge(std::vector{Person(kPersonPx), stands_now}, flow_, last_, &frame_);
  filter.Watch(flow_, last_, kDepth, &frame_);
  EXPECT_LT(MeanInBox(false), kMinStaticProbability) << "the wall, or who stands before it";
  EXPECT_LT(MeanInBox(true), 0.1);
}

TEST_F(DynamicFilterTest, HoweverManyBoxesOverlapMotionOverrulesThem) {
  DynamicFilter filter = Make("weights");
  std::vector<DynamicBox> before, now;
  for (int id = 1; id <= 4; ++id) {
    before.push_back(Person(0));
    now.push_back(Person(kPersonPx));
    before.back().track_id = now.back().track_id = id;
  }
  for (int i = 0; i < 4; ++i) {
    flow_.Clear(last_);
    filter.Judge(before, flow_, frame_, &last_);
    last_.motion_log_odds = i == 0 ? std::vector<float>(last_.features.size(), 0.0f) : frame_.motion_log_odds;
    flow_.Match(last_, filter.Boxes(), {}, frame_);
    filter.Judge(now, flow_, last_, &frame_);
    filter.Watch(flow_, last_, kDepth, &frame_);
  }
  EXPECT_GT(MeanInBox(false), kMinStaticProbability);
  EXPECT_LT(MeanInBox(true), 0.1);
}

TEST_F(DynamicFilterTest, WithoutMotionAllInTheBoxIsDoubted) {
  DynamicOptions options;
  options.motion = false;
  DynamicFilter filter(camera_, options, OctaveScales());
  Run(&filter);
  EXPECT_LT(MeanInBox(false), kMinStaticProbability);
  EXPECT_NEAR(MeanInBox(false), MeanInBox(true), 1e-6);
}

TEST_F(DynamicFilterTest, WhoStandsStillGivesNoEvidence) {
  // The camera rests too: nothing in the image moves.
  frame_.features = last_.features;
  frame_.grid.Build(frame_.features, camera_.IdealBounds());
  frame_.cam_from_world = last_.cam_from_world;
  DynamicFilter filter = Make("weights");
  flow_.Clear(last_);
  filter.Judge(std::vector{Person(0)}, flow_, frame_, &last_);
  flow_.Match(last_, filter.Boxes(), {}, frame_);
  filter.Judge(std::vector{Person(0)}, flow_, last_, &frame_);
  const std::vector<float> before = frame_.static_probability;
  filter.Watch(flow_, last_, kDepth, &frame_);
  EXPECT_EQ(frame_.static_probability, before);
}

TEST_F(DynamicFilterTest, EvidenceOfALandmarkGrowsWhereItFitsAndFallsWhereItDoesNot) {
  const DynamicFilter filter = Make("weights");
  EXPECT_GT(filter.Evidence(0.95f, true), 0);
  EXPECT_LT(filter.Evidence(0.95f, false), filter.Evidence(0.95f, true));
  EXPECT_LT(filter.Evidence(0.5f, false), 0);
  EXPECT_LT(filter.Evidence(0.24f, true), filter.Evidence(0.95f, true));
  // The odds multiply: of a keypoint that says nothing, the landmark's own.
  EXPECT_NEAR(TrustInMatch(0.5f, 0.0f), 0.5, 1e-6);
  EXPECT_NEAR(TrustInMatch(0.5f, 2.0f), 1 / (1 + std::exp(-2.0)), 1e-6);
  EXPECT_EQ(TrustInMatch(1.0f, -4.0f), 1);
  // Nothing is surer than that no object was missed.
  EXPECT_FLOAT_EQ(filter.Evidence(1.0f, true), filter.Evidence(0.95f, true));
}

TEST_F(DynamicFilterTest, AFrameTellsALittleAndNothingIsSurerThanThatNoObjectWasMissed) {
  DynamicFilter filter = Make("weights");
  Run(&filter);
  const auto [least, most] =
      std::minmax_element(frame_.motion_log_odds.begin(), frame_.motion_log_odds.end());
  EXPECT_EQ(*least, -2);
  EXPECT_GT(*most, 1);
  EXPECT_LE(*most, 2);
  EXPECT_NEAR(*std::max_element(frame_.static_probability.begin(), frame_.static_probability.end()), 0.95,
              1e-6);
}

TEST_F(DynamicFilterTest, ACarIsNotTakenForOneThatDroveThereBefore) {
  DynamicFilter filter = Make("weights");
  const DynamicKeypoints first = Run(&filter, Car(200, 0), Car(200, kPersonPx));
  for (int i = 0; i < 3; ++i) Run(&filter, Car(200, 0), Car(200, kPersonPx));
  DynamicBox before = Car(200, 0), now = Car(200, kPersonPx);
  before.track_id = now.track_id = 3;
  const DynamicKeypoints other = Run(&filter, before, now);
  EXPECT_EQ(other.kept, first.kept);
  EXPECT_EQ(other.culled, first.culled);
}

TEST_F(DynamicFilterTest, InTwoBoxesItBelongsToOneOfThem) {
  DynamicOptions options;
  options.motion = false;
  DynamicFilter filter(camera_, options, OctaveScales());
  DynamicBox one = Car(200, 0), other = Car(200, 0);
  one.probability = 0.6;
  other.probability = 0.8;
  other.track_id = 3;
  flow_.Clear(frame_);
  filter.Judge(std::vector{one, other}, flow_, last_, &frame_);
  for (size_t i = 0; i < on_person_.size(); ++i) {
    const Keypoint& keypoint = frame_.features.keypoints[i];
    if (!one.box.Contains(keypoint.raw_x, keypoint.raw_y)) continue;
    EXPECT_NEAR(frame_.static_probability[i], 1 - (1 - 0.2 * 0.2) * 0.7, 1e-6);
  }
}

// A third frame, of which only witnesses among the keypoints of the second one are looked for.
TEST_F(DynamicFilterTest, WitnessesSpeakForTheOthersAroundThem) {
  // The person is in the upper part of the box, the wall in the lower one. Beside each keypoint three weaker
  // ones of the same surface, in the same cell of the grid.
  const size_t n = frame_.features.size();
  const double wall_px = -camera_.fx * kShift / kDepth;
  for (size_t i = 0; i < n; ++i) {
    const Keypoint& in_last = last_.features.keypoints[i];
    on_person_[i] = in_last.y < 300 && Person(0).box.Contains(in_last.x, in_last.y);
    frame_.features.keypoints[i].raw_x = frame_.features.keypoints[i].x =
        static_cast<float>(in_last.x + (on_person_[i] ? kPersonPx : wall_px));
    for (const auto& [dx, dy] : {std::pair{2.0, 0.0}, {0.0, 2.0}, {2.0, 2.0}}) {
      const Keypoint before = last_.features.keypoints[i], now = frame_.features.keypoints[i];
      Add(before.x + dx, before.y + dy, now.x + dx, now.y + dy, on_person_[i]);
    }
    last_.features.keypoints[i].response = frame_.features.keypoints[i].response = 1;
  }
  for (Frame* frame : {&last_, &frame_}) {
    frame->grid.Build(frame->features, camera_.IdealBounds());
    frame->ClearLandmarks();
  }
  DynamicFilter filter = Make("weights");
  Run(&filter);

  // As far again, the person and the camera.
  Frame third = frame_;
  third.timestamp_s += 1.0 / 30;
  third.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {-2 * kShift, 0, 0});
  for (size_t i = 0; i < third.features.size(); ++i) {
    Keypoint& keypoint = third.features.keypoints[i];
    keypoint.raw_x = keypoint.x += keypoint.x - last_.features.keypoints[i].x;
  }
  third.grid.Build(third.features, camera_.IdealBounds());
  flow_.Match(frame_, filter.Boxes(), {}, third, KeypointFlow::Of::kWitnesses);
  EXPECT_TRUE(flow_.IsOfWitnesses());
  filter.Judge(std::vector{Person(2 * kPersonPx)}, flow_, frame_, &third);
  filter.Watch(flow_, frame_, kDepth, &third);
  int others = 0, person = 0, wall = 0, person_told = 0, wall_told = 0;
  third.grid.ForEachCell([&](std::span<const uint32_t> cell) {
    const auto was_followed = [&](uint32_t i) { return flow_.last_keypoints()[i] != kNotFollowed; };
    if (std::ranges::none_of(cell, was_followed)) return;
    for (const uint32_t i : cell) {
      const Keypoint& keypoint = third.features.keypoints[i];
      if (!Person(2 * kPersonPx).box.Contains(keypoint.raw_x, keypoint.raw_y, -20)) continue;
      if (!on_person_[i] && keypoint.raw_y < 300) continue;  // a person would hide it
      others += was_followed(i) ? 0 : 1;
      ++(on_person_[i] ? person : wall);
      if (on_person_[i]) {
        person_told += third.static_probability[i] < 0.1 ? 1 : 0;
      } else {
        wall_told += third.static_probability[i] > kMinStaticProbability ? 1 : 0;
      }
    }
  });
  EXPECT_GT(others, (person + wall) / 2);
  // At the border of both, a witness can be of the other.
  EXPECT_GT(person_told, 0.9 * person);
  EXPECT_GT(wall_told, 0.9 * wall);
}

TEST_F(DynamicFilterTest, EvidenceThatIsOutweighedLeavesTheBox) {
  DynamicFilter filter = Make("weights");
  Run(&filter);
  // What was seen to move as the person did, as surely as it now looks at rest, is as likely either as its
  // box says.
  Frame before = last_;
  before.motion_log_odds.resize(before.features.size());
  for (size_t i = 0; i < before.features.size(); ++i) before.motion_log_odds[i] = -frame_.motion_log_odds[i];
  DynamicOptions options;
  options.past_views = false;
  DynamicFilter other(camera_, options, OctaveScales());
  flow_.Clear(last_);
  other.Judge(std::vector{Person(0)}, flow_, frame_, &last_);
  last_.motion_log_odds = before.motion_log_odds;
  flow_.Match(last_, other.Boxes(), {}, frame_);
  other.Judge(std::vector{Person(kPersonPx)}, flow_, last_, &frame_);
  const std::vector<float> early = frame_.static_probability;
  other.Watch(flow_, last_, kDepth, &frame_);
  int outweighed = 0;
  for (size_t i = 0; i < on_person_.size(); ++i) {
    if (!IsInBox(i) || frame_.motion_log_odds[i] != 0 || before.motion_log_odds[i] == 0) continue;
    ++outweighed;
    EXPECT_NEAR(frame_.static_probability[i], 1 - 0.8 * 0.95, 1e-5);
    EXPECT_NE(frame_.static_probability[i], early[i]);
  }
  EXPECT_GT(outweighed, 10);
}

TEST_F(DynamicFilterTest, LimbsThatSwingAreThePersonsToo) {
  for (size_t i = 0; i < on_person_.size(); ++i) {
    Keypoint& keypoint = frame_.features.keypoints[i];
    if (on_person_[i]) keypoint.raw_x = keypoint.x += (i / 30) % 2 == 0 ? 6 : 0;  // every other row
  }
  frame_.grid.Build(frame_.features, camera_.IdealBounds());
  DynamicFilter filter = Make("weights");
  Run(&filter);
  EXPECT_LT(MeanInBox(true), 0.08);
}

}  // namespace
}  // namespace dynamic_slam
