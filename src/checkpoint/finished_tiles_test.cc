#include "checkpoint/finished_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "compact/compress.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "uneven_model.h"

namespace tomofield::checkpoint {
namespace {

using nlohmann::json;
using testing::message_of;

std::vector<std::int64_t> numbers_of(const std::string& text) { return {text.begin(), text.end()}; }

json tile(int begin, int end) {
  return {{"fitted_rows", {0, 128}},   {"held_out_error", nullptr},  {"rows", {begin, end}},
          {"residual", 1.0},           {"seconds_fitting", 2.0},     {"variance", 1.0},
          {"mean_square_change", 0.1}, {"seconds_compressing", 1.0}, {"decibels", 0.1},
          {"volume", 100.0},           {"parameters", 10},           {"bytes", 100}};
}

// Writes tiles with right checksums, as somebody may have changed them, and reads them.
class FinishedTilesTest : public ::testing::Test {
 protected:
  FinishedTilesTest() : model_(testing::uneven_model(FieldKind::kGrid)) {
    options_.run.output = scratch_ / "run.mrc";
    options_.run.resume = true;
    options_.field.budget = "0.1dB";
    series_.roi = {0, 0, 64, 128};
    series_.geometry = model_.geometry;
    origin_.fingerprint = "the fingerprint";
    model_.coded =
        compact::compress(*model_.field, model_.roi, compact::parse_budget("0.1dB")).coded;
  }

  FinishedTiles read(const json& tiles) {
    const output::TrainingState state{.floats = {},
                                      .doubles = {},
                                      .integers = {{"fingerprint", numbers_of("the fingerprint")},
                                                   {"budget", numbers_of("0.1dB")},
                                                   {"tiles", numbers_of(tiles.dump())}}};
    output::save_coded(output::output_paths(options_.run.output).tiles, *model_.coded, model_,
                       &state);
    return {options_, series_, origin_};
  }

  testing::ScratchDirectory scratch_;
  options::ReconstructOptions options_;
  measurement::Measurement series_;
  FitOrigin origin_;
  output::Model model_;
};

TEST_F(FinishedTilesTest, AreReadIfTheyAreWhole) {
  EXPECT_EQ(read(json::array({tile(0, 64)})).num_rows(), 64);
  const FinishedTiles two = read(json::array({tile(0, 32), tile(32, 96)}));
  EXPECT_EQ(two.num_rows(), 96);
  EXPECT_EQ(two.report().bytes, 200u);
  EXPECT_EQ(two.sum_of(&FinishedTile::seconds_fitting), 4.0);
}

TEST_F(FinishedTilesTest, AreRefusedIfSomebodyHasChangedThem) {
  std::vector<json> damaged = {json::array(),    json::object(),
                               nullptr,          "text",
                               json::array({1}), json::array({tile(0, 32), tile(64, 96)})};
  for (const auto& [begin, end] : {std::pair(0, 128), {0, 200}, {0, 33}, {1, 64}, {0, 0}, {64, 0}})
    damaged.push_back(json::array({tile(begin, end)}));
  for (const double change : {1e30, -0.1}) {
    json changed = tile(0, 64);
    changed["mean_square_change"] = change;
    damaged.push_back(json::array({changed}));
  }
  for (const char* key : {"rows", "residual", "seconds_fitting", "seconds_compressing", "bytes"})
    for (const json& value : {json(), json("1"), json(-1e300), json{1, 2, 3}}) {
      json changed = tile(0, 64);
      changed[key] = value;
      damaged.push_back(json::array({changed}));
    }
  for (const json& tiles : damaged)
    EXPECT_NE(message_of<Error>([&] { read(tiles); }).find("run_tiles.h5"), std::string::npos)
        << tiles.dump();
}

TEST_F(FinishedTilesTest, AreRefusedIfTheirFieldIsAnother) {
  const auto refusal = [&] { return message_of<Error>([&] { read(json::array({tile(0, 64)})); }); };
  EXPECT_EQ(refusal(), "");
  model_.density_unit = 0;
  EXPECT_NE(refusal().find("density_unit"), std::string::npos) << refusal();
  model_.density_unit = 40;
  const std::vector<double> steps = model_.coded->codes.step;
  std::ranges::fill(model_.coded->codes.step, 0);
  EXPECT_NE(refusal().find("step of 0"), std::string::npos) << refusal();
  model_.coded->codes.step = steps;
  series_.geometry.thickness += 1;
  EXPECT_NE(refusal().find("thick"), std::string::npos) << refusal();
}

TEST_F(FinishedTilesTest, AreRefusedIfTheirNumbersAreNoDensities) {
  std::ranges::fill(model_.coded->codes.step, 1e9);
  const std::string message = message_of<Error>([&] { read(json::array({tile(0, 64)})); });
  EXPECT_NE(message.find("no densities"), std::string::npos) << message;
}

TEST_F(FinishedTilesTest, AreRefusedIfACodeIsDamaged) {
  std::vector<std::uint8_t>& bytes = model_.coded->codes.bytes;
  bytes[bytes.size() / 2] ^= 0xFF;
  const std::string message = message_of<Error>([&] { read(json::array({tile(0, 64)})); });
  EXPECT_NE(message.find("is damaged"), std::string::npos) << message;
}

TEST_F(FinishedTilesTest, RefuseATileThatDoesNotFollowTheirField) {
  FinishedTiles tiles = read(json::array({tile(0, 64)}));
  EXPECT_NE(message_of<Error>([&] {
              tiles.add({.rows = {64, 96}}, *model_.coded);
            }).find("run_tiles.h5"),
            std::string::npos);
}

}  // namespace
}  // namespace tomofield::checkpoint
