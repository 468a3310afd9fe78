#include "checkpoint/tile_record.h"

#include <fmt/format.h>

#include <cmath>

#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::checkpoint {
namespace {

using nlohmann::json;

constexpr double kLargestNumber = 1e15;
constexpr std::int64_t kLargestCount = std::int64_t{1} << 48;

json tile_json(const FinishedTile& tile) {
  const compact::CompressionReport& report = tile.report;
  return {{"rows", {tile.rows.begin, tile.rows.end}},
          {"fitted_rows", {tile.fitted_rows.begin, tile.fitted_rows.end}},
          {"residual", tile.residual},
          {"held_out_error", tile.held_out_error ? json(*tile.held_out_error) : json(nullptr)},
          {"seconds_fitting", tile.seconds_fitting},
          {"seconds_compressing", tile.seconds_compressing},
          {"parameters", report.parameters},
          {"bytes", report.bytes},
          {"mean_square_change", report.mean_square_change},
          {"variance", report.variance},
          {"decibels", report.decibels},
          {"volume", report.volume}};
}

double number_at(const json& tile, const char* key) {
  return io::number_at(tile, key, -kLargestNumber, kLargestNumber);
}

std::size_t count_at(const json& tile, const char* key) {
  return static_cast<std::size_t>(io::integer_at(tile, key, 0, kLargestCount));
}

base::Range rows_at(const json& tile, const char* key, std::int64_t last) {
  const std::vector<double> rows = io::numbers_at(tile, key, 0, static_cast<double>(last));
  const bool are_rows = rows.size() == 2 && rows[0] == std::floor(rows[0]) &&
                        rows[1] == std::floor(rows[1]) && rows[0] < rows[1];
  if (!are_rows) throw Error(std::string("'") + key + "' are no rows of the region");
  return {static_cast<int>(rows[0]), static_cast<int>(rows[1])};
}

FinishedTile tile_from(const json& tile, std::int64_t num_rows) {
  FinishedTile read{.rows = rows_at(tile, "rows", num_rows - 1),
                    .fitted_rows = rows_at(tile, "fitted_rows", num_rows),
                    .residual = number_at(tile, "residual"),
                    .seconds_fitting = number_at(tile, "seconds_fitting"),
                    .seconds_compressing = number_at(tile, "seconds_compressing"),
                    .report = {.parameters = count_at(tile, "parameters"),
                               .bytes = count_at(tile, "bytes"),
                               .mean_square_change = number_at(tile, "mean_square_change"),
                               .variance = number_at(tile, "variance"),
                               .decibels = number_at(tile, "decibels"),
                               .volume = number_at(tile, "volume")}};
  // Even a model of nothing changes a tile by little more than its variance.
  constexpr double kLargestChange = 1e3;
  const compact::CompressionReport& report = read.report;
  if (report.mean_square_change < 0.0 ||
      report.mean_square_change > kLargestChange * std::fabs(report.variance))
    throw Error(fmt::format("its mean_square_change of {:g} is none for a variance of {:g}",
                            report.mean_square_change, report.variance));
  if (tile.contains("held_out_error") && !tile.at("held_out_error").is_null())
    read.held_out_error = number_at(tile, "held_out_error");
  return read;
}

}  // namespace

json to_json(const std::vector<FinishedTile>& tiles) {
  json list = json::array();
  for (const FinishedTile& tile : tiles) list.push_back(tile_json(tile));
  return list;
}

std::string text_of(const std::vector<FinishedTile>& tiles) { return to_json(tiles).dump(); }

std::vector<FinishedTile> tiles_from(const std::string& text, std::int64_t num_rows) {
  const json list = io::parse_json(text);
  if (!list.is_array() || list.empty()) throw Error("it has no tiles");
  std::vector<FinishedTile> tiles;
  for (const json& tile : list) {
    tiles.push_back(tile_from(tile, num_rows));
    const int first = tiles.size() > 1 ? tiles[tiles.size() - 2].rows.end : 0;
    if (tiles.back().rows.begin != first) throw Error("its tiles do not follow each other");
  }
  return tiles;
}

}  // namespace tomofield::checkpoint
