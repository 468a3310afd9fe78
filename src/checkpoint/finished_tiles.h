#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "checkpoint/checkpoint.h"
#include "checkpoint/tile_record.h"
#include "compact/coded_field.h"
#include "compact/compress.h"
#include "distributed/communicator.h"
#include "measurement/measurement.h"
#include "options/run_options.h"

namespace tomofield::checkpoint {

/// Removes the tiles that an earlier run left: a run from the start replaces them, and a resumed
/// one must not take them for its own.
void forget_old_tiles(const options::ReconstructOptions& options,
                      const distributed::Communicator& processes);

/// The codes of the tiles that a run has finished, from the first row of the region on. They are
/// kept in a file, from which a run resumes.
class FinishedTiles {
 public:
  /// Reads what an earlier run has finished, if the run resumes. Throws Error if the file is of
  /// another fit, or of tiles or a budget of another size. All references must outlive the object.
  FinishedTiles(const options::ReconstructOptions& options, const measurement::Measurement& series,
                const FitOrigin& origin);

  /// Appends a tile and the codes of its own rows. Throws Error if it does not follow the tiles of
  /// the file, which somebody has changed.
  void add(const FinishedTile& tile, compact::CodedField coded);
  /// Writes the file, unless the run writes none.
  void save() const;
  void remove_file() const;

  int num_rows() const;  ///< of the finished tiles
  const compact::CodedField& coded() const { return *coded_; }
  compact::CodedField take() { return std::move(*coded_); }
  compact::CompressionReport report() const;
  const std::vector<FinishedTile>& tiles() const { return tiles_; }
  /// Returns the sum of a number of all tiles, or its mean over their rows.
  double sum_of(double FinishedTile::*number) const;
  double mean_of(double FinishedTile::*number) const;

 private:
  bool writes_file() const { return !options_.run.output.empty(); }
  void read();
  /// Throws Error for a tile that ends within a leaf.
  void require_whole_leaves() const;

  const options::ReconstructOptions& options_;
  const measurement::Measurement& series_;
  const FitOrigin& origin_;
  std::filesystem::path path_;
  std::optional<compact::CodedField> coded_;
  std::vector<FinishedTile> tiles_;
};

}  // namespace tomofield::checkpoint
