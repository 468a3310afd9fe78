#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/range.h"
#include "checkpoint/checkpoint.h"
#include "compact/coded_field.h"
#include "compact/compress.h"
#include "distributed/communicator.h"
#include "measurement/measurement.h"
#include "options/run_options.h"

namespace tomofield::checkpoint {

/// The codes of the own rows of a tile.
struct TileCodes {
  compact::CodedField coded;
  compact::CompressionReport report;
  double seconds = 0.0;  ///< of the compression
};

/// Removes the tiles that an earlier run left: a run from the start replaces them, and a resumed
/// one must not take them for its own.
void forget_old_tiles(const options::ReconstructOptions& options,
                      const distributed::Communicator& processes);

/// The codes of the tiles that a run has finished, from the first row of the region on. They are
/// kept in a file, from which a run resumes.
class FinishedTiles {
 public:
  /// Reads what an earlier run has finished, if the run resumes. Throws Error if the file is of
  /// another fit or of another budget. All references must outlive the object.
  FinishedTiles(const options::ReconstructOptions& options, const measurement::Measurement& series,
                const FitOrigin& origin);

  /// Appends a tile: its own rows, counted from the first one of the region. `json` says how it was
  /// fitted.
  void add(base::Range rows, TileCodes codes, nlohmann::json json);
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
  bool writes_file() const { return !options_.run.output.empty(); }
  void read();

  const options::ReconstructOptions& options_;
  const measurement::Measurement& series_;
  const FitOrigin& origin_;
  std::filesystem::path path_;
  std::optional<compact::CodedField> coded_;
  nlohmann::json tiles_ = nlohmann::json::array();
};

}  // namespace tomofield::checkpoint
