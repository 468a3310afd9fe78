#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment_record.h"
#include "base/range.h"
#include "checkpoint/tile_record.h"
#include "compact/compress.h"
#include "evaluate/resolution/fsc.h"
#include "option_table/setting.h"
#include "record/fit_metrics.h"
#include "tune/trial_settings.h"
#include "verdict/verdict.h"

namespace tomofield::record {

/// Collects what is recorded of one fit of a run.
struct FitRecord {
  FitMetrics metrics;
  verdict::Verdict verdict;
  std::optional<alignment::AlignmentRecord> alignment;  ///< that was made before the fit, if any
  std::optional<tune::TunedFit> tuned;                  ///< the trials that chose settings
};

/// The compression of a model.
struct CompactRecord {
  compact::CompressionReport report;
  double seconds = 0.0;
};

/// The tiles of a run. The metrics are those of the fit of one of them.
struct TilesRecord {
  base::Range example;  ///< rows of the tile whose fit speaks for all
  std::vector<checkpoint::FinishedTile> tiles;
};

/// The shell correlation of two volumes.
struct FscRecord {
  evaluate::Fsc fsc;
  evaluate::FscFiles files;
};

/// The fits of both halves of the data, and what they tell.
struct HalvesRecord {
  struct OfHalf {
    std::filesystem::path volume, model;
    FitRecord fit;
  };
  bool are_of_tilts = false;     ///< else of frames
  std::array<OfHalf, 2> halves;  ///< [tilt_series::Half]
  FscRecord fsc;
  std::optional<FscRecord> linear;  ///< of the linear halves, if they were written
  std::filesystem::path local_resolution, uncertainty;
  double median_A = 0.0;  ///< of the local resolution, and its finest and coarsest tenth
  double finest_tenth_A = 0.0, coarsest_tenth_A = 0.0;
};

/// The record of a run, the JSON file beside its volume.
struct RunRecord {
  nlohmann::json options;         ///< options::options_json()
  std::vector<Setting> settings;  ///< where they come from
  FitRecord fit;                  ///< of all data
  std::optional<CompactRecord> compact = {};
  std::optional<TilesRecord> tiles = {};
  std::optional<HalvesRecord> halves = {};
};

/// Returns the text of the file, and writes it.
std::string text_of(const RunRecord& record);
void write_record(const std::filesystem::path& file, const RunRecord& record);

}  // namespace tomofield::record
