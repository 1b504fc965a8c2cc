#include "dynamic_slam/base/thread_priority.h"

#ifdef __linux__
#include <algorithm>

#include <sys/resource.h>
#include <unistd.h>
#endif

namespace dynamic_slam {

#ifdef __linux__
namespace {

id_t ThisThread() { return static_cast<id_t>(gettid()); }

}  // namespace

void GiveWayToOthers() {
  constexpr int kNiceness = 10;  // the scheduler weighs it 110, and 0 1024
  setpriority(PRIO_PROCESS, ThisThread(), std::max(kNiceness, getpriority(PRIO_PROCESS, ThisThread())));
}

UrgentSection::UrgentSection(bool wanted) {
  constexpr int kNicer = 10;  // -10 is weighed 9548: beside one other thread, nine tenths of a processor
  if (!wanted) return;
  niceness_ = getpriority(PRIO_PROCESS, ThisThread());
  is_raised_ = setpriority(PRIO_PROCESS, ThisThread(), std::max(-20, niceness_ - kNicer)) == 0;
}

UrgentSection::~UrgentSection() {
  if (is_raised_) setpriority(PRIO_PROCESS, ThisThread(), niceness_);
}
#else
void GiveWayToOthers() {}
UrgentSection::UrgentSection(bool) {}
UrgentSection::~UrgentSection() = default;
#endif

}  // namespace dynamic_slam
