#pragma once

#include <cmath>

namespace dynamic_slam {

// No landmark is made of a keypoint whose P(at rest) is below this, and it takes no part in the start.
inline constexpr float kMinStaticProbability = 0.5f;

// A landmark's evidence is bounded, so that what was at rest for long and moves off is found out in seconds.
inline constexpr float kMaxStaticLogOdds = 4;

// P(at rest) of a match: of a keypoint, and the log-odds of the landmark that it shows. It is the match's weight
// in the optimisation of poses and of the map.
inline double TrustInMatch(float static_probability, float static_log_odds) {
  if (static_probability >= 1) return 1;
  const double odds = static_probability / (1.0 - static_probability) * std::exp(static_log_odds);
  return odds / (1 + odds);
}

}  // namespace dynamic_slam
