#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "output/model_file.h"

namespace tomofield::output {

/// What the options of a model's run say of the views, as far as they say it.
struct ModelInput {
  std::map<std::string, std::filesystem::path> files;  ///< by the keys of their options: "stack"
  double bin = 1;                                      ///< of the views, at least 1
};
ModelInput input_of(const ModelInfo& info);

/// Returns the order of the axes in the tomogram that a model's run wrote, as far as its options
/// say it: else x, y, z.
VolumeAxes axes_of_tomogram(const ModelInfo& info);

/// Returns the labels of a volume's header: which program and version made it and how, and the
/// names of the files that the series was read and aligned by. The complete command is in the
/// metrics: the same data give the same bytes wherever the results are written.
std::vector<std::string> volume_labels(const ModelInfo& info, const std::string& made_by);

}  // namespace tomofield::output
