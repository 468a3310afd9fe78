#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "compact/coded_field.h"
#include "compact/compress.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/run.h"
#include "reconstruct/tiles.h"

namespace tomofield::reconstruction {

/// The codes of the own rows of a tile.
struct TileCodes {
  compact::CodedField coded;
  compact::CompressionReport report;
  double seconds = 0.0;  ///< of the compression
};

/// Removes the tiles that an earlier run left: a run from the start replaces them, and a resumed
/// one must not take them for its own.
void forget_old_tiles(const Run& run);

/// The codes of the tiles that a run has finished, from the first row of the region on. They are
/// kept in a file, from which a run resumes.
class FinishedTiles {
 public:
  /// Reads what an earlier run has finished, if the run resumes. Throws Error if the file is of
  /// another fit or of another budget.
  FinishedTiles(const Run& run, const FitOrigin& origin);

  /// Appends a tile. `json` says how it was fitted.
  void add(const Tile& tile, TileCodes codes, nlohmann::json json);
  /// Writes the file, unless the run writes none.
  void save() const;
  void remove_file() const;

  int num_rows() const;  ///< of the finished tiles
  const compact::CodedField& coded() const { return *coded_; }
  compact::CodedField take() { return std::move(*coded_); }
  compact::CompressionReport report() const;
  const nlohmann::json& tiles_json() const { return tiles_; }
  /// Returns the sum of a number of all tiles, or its mean over their rows.
  double sum_of(const char* key) const;
  double mean_of(const char* key) const;

 private:
  void read(const FitOrigin& origin);

  const Run& run_;
  const FitOrigin& origin_;
  std::optional<compact::CodedField> coded_;
  nlohmann::json tiles_ = nlohmann::json::array();
};

}  // namespace tomofield::reconstruction
