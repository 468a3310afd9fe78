#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/range.h"
#include "compact/compress.h"

namespace tomofield::checkpoint {

/// Describes a tile that is fitted and compressed. Rows count from the first one of the region.
struct FinishedTile {
  base::Range rows = {};                      ///< its own
  base::Range fitted_rows = {};               ///< with those beside them
  double residual = 0.0;                      ///< mean squared residual over the noise variance
  std::optional<double> held_out_error = {};  ///< none if no views are held out
  double seconds_fitting = 0.0;
  double seconds_compressing = 0.0;
  compact::CompressionReport report = {};
};

nlohmann::json to_json(const std::vector<FinishedTile>& tiles);
std::string text_of(const std::vector<FinishedTile>& tiles);

/// Reads tiles that somebody may have changed. Throws Error unless they lie side by side from row 0
/// on, and leave rows of a region of `num_rows` for another one.
std::vector<FinishedTile> tiles_from(const std::string& text, std::int64_t num_rows);

}  // namespace tomofield::checkpoint
