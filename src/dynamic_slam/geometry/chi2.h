#pragma once

namespace dynamic_slam {

// 95% quantiles of chi-squared: a squared error in sigmas above them is an outlier.
inline constexpr double kChi2OneDof = 3.841;   // distance to a line
inline constexpr double kChi2TwoDof = 5.991;   // distance to a point
inline constexpr double kChi2FourDof = 9.488;  // distance to a box

}  // namespace dynamic_slam
