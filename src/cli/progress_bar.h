#pragma once

#include "base/progress.h"

namespace tomofield::cli {

/// Shows progress on standard error: a bar that redraws itself on a terminal,
/// a plain line every few seconds otherwise. `title` begins every line.
base::ProgressSink make_progress_bar(const std::string& title);

/// "2 h 05 min", "3 min 20 s" or "12 s".
std::string format_duration(double seconds);

}  // namespace tomofield::cli
