#include "dynamic_slam/features/corner_selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

namespace dynamic_slam {
namespace {

// Levels take turns with the buffers, so these keep the size of the largest, and grow by half of it at least.
template <class T>
void GrowTo(size_t size, std::vector<T>* buffer) {
  if (buffer->size() < size) buffer->resize(std::max(size, buffer->size() + buffer->size() / 2));
}

}  // namespace

void ShareOverLevels(int wanted, const std::vector<double>& weights, const std::vector<int>& available,
                     std::vector<int>* shares) {
  constexpr int kOpen = -1;  // a level that may have more than its share
  const size_t levels = weights.size();
  shares->assign(levels, kOpen);
  int left = wanted;
  double scale = 0;
  for (bool again = true; again;) {
    again = false;
    double weight_left = 0;
    for (size_t i = 0; i < levels; ++i) weight_left += (*shares)[i] == kOpen ? weights[i] : 0;
    if (weight_left <= 0) return;
    scale = left / weight_left;
    for (size_t i = 0; i < levels; ++i) {
      if ((*shares)[i] != kOpen || weights[i] * scale < available[i]) continue;
      (*shares)[i] = available[i];
      left -= available[i];
      again = true;
    }
  }
  // Rounds the running sum, not the shares, so that they add up.
  double sum = 0;
  int given = 0;
  for (size_t i = 0; i < levels; ++i) {
    if ((*shares)[i] != kOpen) continue;
    sum += weights[i] * scale;
    (*shares)[i] = std::min(available[i], static_cast<int>(std::lround(sum)) - given);
    given += (*shares)[i];
  }
}

void CornerSelector::Select(int width, int height, int wanted, int weak_score,
                            std::span<const uint8_t> rounds_late, std::vector<Corner>* corners) {
  constexpr int kRounds = 256;  // the last one takes all that is left
  const size_t count = corners->size();
  if (wanted <= 0) corners->clear();
  if (wanted <= 0 || count <= static_cast<size_t>(wanted)) return;

  // Counting sort, stable: corners of one score stay in the order of y, x.
  std::array<uint32_t, 257> begin{};
  for (const Corner& corner : *corners) ++begin[255 - corner.score + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  GrowTo(count, &by_score_);
  for (size_t i = 0; i < count; ++i) by_score_[begin[255 - (*corners)[i].score]++] = static_cast<uint32_t>(i);

  const double cell_px = std::max(4.0, std::sqrt(static_cast<double>(width) * height / wanted));
  const float per_px = static_cast<float>(1 / cell_px);
  const int columns = static_cast<int>(width * per_px) + 1, rows = static_cast<int>(height * per_px) + 1;
  const size_t cells = static_cast<size_t>(columns) * rows;
  GrowTo(cells, &in_cell_);
  std::fill_n(in_cell_.begin(), cells, uint16_t{0});
  in_round_.assign(kRounds, 0);
  GrowTo(count, &round_);
  const std::span strongest_first(by_score_.data(), count);
  for (const uint32_t index : strongest_first) {
    const Corner& corner = (*corners)[index];
    const int cell = static_cast<int>(corner.y * per_px) * columns + static_cast<int>(corner.x * per_px);
    const int late = (corner.score <= weak_score ? 1 : 0) + (rounds_late.empty() ? 0 : rounds_late[index]);
    round_[index] = static_cast<uint16_t>(std::min(in_cell_[cell]++ + late, kRounds - 1));
    ++in_round_[round_[index]];
  }

  int last_round = 0, left = wanted;  // left: places for corners of the last round
  while (left > static_cast<int>(in_round_[last_round])) left -= static_cast<int>(in_round_[last_round++]);
  constexpr uint16_t kDropped = UINT16_MAX;
  for (const uint32_t index : strongest_first) {
    if (round_[index] < last_round) continue;
    if (round_[index] > last_round || left-- <= 0) round_[index] = kDropped;
  }
  size_t kept = 0;
  for (size_t i = 0; i < count; ++i) {
    if (round_[i] != kDropped) (*corners)[kept++] = (*corners)[i];
  }
  corners->resize(kept);
}

}  // namespace dynamic_slam
