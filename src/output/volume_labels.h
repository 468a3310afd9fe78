#pragma once

#include <string>
#include <vector>

#include "output/model_file.h"

namespace tomofield::output {

/// Returns the labels of a volume's header: which program and version made it and how, and the
/// names of the files that the series was read and aligned by. The complete command is in the
/// metrics: the same data give the same bytes wherever the results are written.
std::vector<std::string> volume_labels(const ModelInfo& info, const std::string& made_by);

}  // namespace tomofield::output
