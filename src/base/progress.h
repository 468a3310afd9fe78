#pragma once

#include <functional>
#include <string>
#include <utility>

namespace tomofield::base {

/// The progress of a long computation. A sink receives it and may draw it.
struct ProgressReport {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  std::string detail;  ///< a few words on the state, such as the loss
};
/// Returns a report whose remaining time is extrapolated from `fraction_done`, which is above 0.
inline ProgressReport progress_at(double fraction_done, double seconds_elapsed,
                                  std::string detail) {
  return {fraction_done, seconds_elapsed, seconds_elapsed * (1 - fraction_done) / fraction_done,
          std::move(detail)};
}
using ProgressSink = std::function<void(const ProgressReport&)>;

}  // namespace tomofield::base
