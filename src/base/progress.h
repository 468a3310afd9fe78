#pragma once

#include <functional>
#include <string>

namespace tomofield::base {

/// How far a long computation is; handed to a sink, which may draw it.
struct ProgressReport {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  std::string detail;  ///< what else is worth seeing, such as the loss: a few words
};
using ProgressSink = std::function<void(const ProgressReport&)>;

}  // namespace tomofield::base
