#include "dynamic_slam/semantics/make_compensation.h"

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

std::unique_ptr<BoxCompensation> MakeBoxCompensation(const CompensationOptions& options,
                                                     const Camera& camera) {
  if (options.method == "tracker") return std::make_unique<TrackerCompensation>(options.tracker, camera);
  DS_CHECK(options.method == "paper" || options.method == "none", "method={}", options.method);
  // Without compensation there is nothing to miss: every box is given up at once.
  PaperCompensationOptions paper = options.paper;
  if (options.method == "none") paper.max_misses = 0;
  return std::make_unique<PaperCompensation>(paper, camera);
}

}  // namespace dynamic_slam
