#include "checkpoint/finished_tiles.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/trace.h"
#include "compact/decoded_field.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::checkpoint {

void forget_old_tiles(const options::ReconstructOptions& options,
                      const distributed::Communicator& processes) {
  std::error_code ignored;
  const std::filesystem::path& output = options.run.output;
  if (!output.empty() && processes.is_root() && options.may_use_tiles())
    std::filesystem::remove(output::output_paths(output).tiles, ignored);
}

FinishedTiles::FinishedTiles(const options::ReconstructOptions& options,
                             const measurement::Measurement& series, const FitOrigin& origin)
    : options_(options),
      series_(series),
      origin_(origin),
      path_(output::output_paths(options.run.output).tiles) {
  if (!writes_file() || !options.run.resume || !std::filesystem::exists(path_)) return;
  read_checkpoint([&] { read(); });
  base::log_info(fmt::format("resuming {} after row {}", path_.string(), num_rows()));
}

void FinishedTiles::read() {
  const std::string path = path_.string();
  output::TrainingState state;
  output::Model model = output::load_undecoded(path, &state);
  const auto text = [&](const char* name) { return as_text(state.integers[name]); };
  if (!model.coded || text("fingerprint") != origin_.fingerprint)
    throw Error(fmt::format("'{}' was made from another series or with other options", path));
  if (model.coded->thickness != series_.geometry.thickness)
    throw Error(
        fmt::format("'{}' is damaged: its field is {} pixels thick, and this run's {}; "
                    "--overwrite starts over",
                    path, model.coded->thickness, series_.geometry.thickness));
  if (text("budget") != options_.field.budget)
    throw Error(fmt::format("'{}' was made with --budget {}: give the same", path, text("budget")));
  if (const auto& rows = state.integers["tile_rows"];
      origin_.tile_rows && rows != std::vector<std::int64_t>{*origin_.tile_rows})
    throw Error(fmt::format("'{}' was made with --tile-rows {}: give the same", path,
                            fmt::join(rows, ", ")));
  try {
    tiles_ = tiles_from(text("tiles"), series_.roi.height());
    require_whole_leaves();
    compact::require_sound(*model.coded);
  } catch (const std::exception& error) {
    throw Error(fmt::format("'{}' is damaged: {}", path, error.what()));
  }
  coded_ = std::move(model.coded);
}

void FinishedTiles::require_whole_leaves() const {
  const int leaf_rows = *options_.field.leaf_size;
  for (const FinishedTile& tile : tiles_)
    if (tile.rows.end % leaf_rows != 0 && tile.rows.end != series_.roi.height())
      throw Error(fmt::format("a tile ends at row {}, where no leaf of {} rows does", tile.rows.end,
                              leaf_rows));
}

void FinishedTiles::add(const FinishedTile& tile, compact::CodedField coded) {
  base::log_info(fmt::format("rows {} to {}: {} parameters in {} bytes", tile.rows.begin,
                             tile.rows.end, tile.report.parameters, tile.report.bytes));
  if (coded_ && !is_joinable(*coded_, coded))
    throw Error(
        fmt::format("'{}' is damaged: its field does not end where its tiles do; "
                    "--overwrite starts over",
                    path_.string()));
  tiles_.push_back(tile);
  if (coded_)
    append(*coded_, coded);
  else
    coded_ = std::move(coded);
}

void FinishedTiles::save() const {
  if (!writes_file()) return;
  const base::TraceSpan span("write tiles");
  const output::TrainingState state{.floats = {},
                                    .doubles = {},
                                    .integers = {{"fingerprint", as_numbers(origin_.fingerprint)},
                                                 {"budget", as_numbers(options_.field.budget)},
                                                 {"tile_rows", {origin_.tile_rows.value_or(0)}},
                                                 {"tiles", as_numbers(text_of(tiles_))}}};
  output::save_coded(path_, *coded_, model_info(series_, options_), &state);
}

void FinishedTiles::remove_file() const {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

int FinishedTiles::num_rows() const { return tiles_.empty() ? 0 : tiles_.back().rows.end; }

compact::CompressionReport FinishedTiles::report() const {
  compact::CompressionReport all = tiles_.front().report;
  for (std::size_t i = 1; i < tiles_.size(); ++i) all = compact::joined(all, tiles_[i].report);
  return all;
}

double FinishedTiles::sum_of(double FinishedTile::*number) const {
  double sum = 0;
  for (const FinishedTile& tile : tiles_) sum += tile.*number;
  return sum;
}

double FinishedTiles::mean_of(double FinishedTile::*number) const {
  double sum = 0, rows = 0;
  for (const FinishedTile& tile : tiles_) {
    sum += tile.rows.size() * tile.*number;
    rows += tile.rows.size();
  }
  return sum / rows;
}

}  // namespace tomofield::checkpoint
