#pragma once

#include "base/progress.h"

namespace tomofield::cli {

/// Returns a sink that shows progress on standard error: a bar that redraws itself on a terminal,
/// and a plain line every few seconds otherwise. `title` begins every line.
base::ProgressSink make_progress_bar(const std::string& title);

}  // namespace tomofield::cli
