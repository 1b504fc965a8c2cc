#pragma once

namespace dynamic_slam {

// Niceness of single threads, which Linux has against POSIX; elsewhere these do nothing. Threads that are
// started meanwhile inherit it.

// For the rest of its life the calling thread gets a processor when the others leave one, or about a tenth of
// one.
void GiveWayToOthers();

// While it lives, the calling thread comes before others of the same niceness, also those of other programs,
// where the system lets it: for root, or with a limit on niceness (ulimit -e, LimitNICE= of systemd) of 30 or
// more. Does nothing where it may not, or when `wanted` is false.
class UrgentSection {
 public:
  explicit UrgentSection(bool wanted = true);
  ~UrgentSection();
  UrgentSection(const UrgentSection&) = delete;
  UrgentSection& operator=(const UrgentSection&) = delete;

 private:
  bool is_raised_ = false;
  int niceness_ = 0;  // before
};

}  // namespace dynamic_slam
