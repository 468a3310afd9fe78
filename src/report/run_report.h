#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "align/alignment_record.h"
#include "tomofield/options.h"

namespace tomofield::report {

/// The pictures that a report shows (PNG).
struct ReportPictures {
  std::filesystem::path mask;
  std::optional<std::filesystem::path> tree, held_out, dial, prior;
};

/// What the report of a run is made from. Files may still have temporary names.
struct ReportSource {
  const nlohmann::json& record;  ///< the content of the JSON file beside the volume
  const SeriesFiles& files;      ///< of the series
  const Options& options;        ///< as the run used them
  const std::optional<alignment::AlignmentRecord>& alignment;  ///< before the fit, if there was one
  std::filesystem::path volume;  ///< the file that holds the tomogram (MRC)
  ReportPictures pictures;
};

/// Returns the report of a finished run: a page in one file that needs no network (docs/report.md).
/// Throws Error if one of the files cannot be read.
std::string run_report(const ReportSource& source);

}  // namespace tomofield::report
