#pragma once

#include <functional>
#include <string>
#include <utility>

namespace tomofield::base {

/// How far a long computation is; handed to a sink, which may draw it.
struct ProgressReport {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  std::string detail;  ///< what else is worth seeing, such as the loss: a few words
};
/// A report whose remaining time is what `fraction_done`, above 0, took.
inline ProgressReport progress_at(double fraction_done, double seconds_elapsed,
                                  std::string detail) {
  return {fraction_done, seconds_elapsed, seconds_elapsed * (1 - fraction_done) / fraction_done,
          std::move(detail)};
}
using ProgressSink = std::function<void(const ProgressReport&)>;

}  // namespace tomofield::base
