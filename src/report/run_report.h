#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tomofield/options.h"

namespace tomofield::report {

/// What the report of a run is made from. Files may still have temporary names.
struct ReportSource {
  const nlohmann::json& record;  ///< the content of the JSON file beside the volume
  const SeriesFiles& files;      ///< of the series
  const Options& requested;      ///< as the user gave them
  std::filesystem::path volume;  ///< the file that holds the tomogram (MRC)
  std::filesystem::path mask_picture;
  std::optional<std::filesystem::path> tree_picture, held_out_picture, dial_picture, prior_picture;
};

/// Returns the report of a finished run: a page in one file that needs no network (docs/report.md).
/// Throws Error if one of the files cannot be read.
std::string run_report(const ReportSource& source);

}  // namespace tomofield::report
