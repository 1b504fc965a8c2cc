#include "continuous_path.h"

namespace dynamic_slam {

void ContinuousPath::Add(const Rigid3& map_from_body, bool is_jump) {
  last_from_body_.reset();
  if (!is_first_ && !is_jump) {
    last_from_body_ = map_from_body_.Inverse() * map_from_body;
    odom_from_body_ = odom_from_body_ * *last_from_body_;
  }
  map_from_body_ = map_from_body;
  is_first_ = false;
}

}  // namespace dynamic_slam
