#include "checkpoint/finished_tiles.h"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/trace.h"
#include "io/json_numbers.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::checkpoint {
namespace {

double rows_of(const nlohmann::json& tile) {
  return tile.at("rows").at(1).get<double>() - tile.at("rows").at(0).get<double>();
}

compact::CompressionReport report_of(const nlohmann::json& tile) {
  return tile.get<compact::CompressionReport>();
}

}  // namespace

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
  if (text("budget") != options_.field.budget)
    throw Error(fmt::format("'{}' was made with --budget {}: give the same", path, text("budget")));
  try {
    tiles_ = io::parse_json(text("tiles"));
    for (const nlohmann::json& tile : tiles_) report_of(tile);
    if (num_rows() <= 0) throw Error("it has no tiles");
  } catch (const std::exception& error) {
    throw Error(fmt::format("'{}' is damaged: {}", path, error.what()));
  }
  coded_ = std::move(model.coded);
}

void FinishedTiles::add(base::Range rows, TileCodes codes, nlohmann::json json) {
  const compact::CompressionReport& report = codes.report;
  json["seconds_compressing"] = codes.seconds;
  json.update(report);
  base::log_info(fmt::format("rows {} to {}: {} parameters in {} bytes", rows.begin, rows.end,
                             report.parameters, report.bytes));
  tiles_.push_back(std::move(json));
  if (coded_)
    append(*coded_, codes.coded);
  else
    coded_ = std::move(codes.coded);
}

void FinishedTiles::save() const {
  if (!writes_file()) return;
  const base::TraceSpan span("write tiles");
  const output::TrainingState state{.floats = {},
                                    .doubles = {},
                                    .integers = {{"fingerprint", as_numbers(origin_.fingerprint)},
                                                 {"budget", as_numbers(options_.field.budget)},
                                                 {"tile_rows", {origin_.tile_rows.value_or(0)}},
                                                 {"tiles", as_numbers(tiles_.dump())}}};
  output::save_coded(path_, *coded_, model_info(series_, options_), &state);
}

void FinishedTiles::remove_file() const {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

int FinishedTiles::num_rows() const {
  return tiles_.empty() ? 0 : tiles_.back().at("rows").at(1).get<int>();
}

compact::CompressionReport FinishedTiles::report() const {
  compact::CompressionReport all = report_of(tiles_.front());
  for (std::size_t i = 1; i < tiles_.size(); ++i) all = compact::joined(all, report_of(tiles_[i]));
  return all;
}

double FinishedTiles::sum_of(const char* key) const {
  double sum = 0;
  for (const nlohmann::json& tile : tiles_) sum += tile.at(key).get<double>();
  return sum;
}

double FinishedTiles::mean_of(const char* key) const {
  double sum = 0, rows = 0;
  for (const nlohmann::json& tile : tiles_) {
    sum += rows_of(tile) * tile.at(key).get<double>();
    rows += rows_of(tile);
  }
  return sum / rows;
}

}  // namespace tomofield::checkpoint
