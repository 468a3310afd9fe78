#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scratch_directory.h"
#include "simulate/project_phantom.h"
#include "tomofield/error.h"
#include "tomofield/reconstruct.h"

namespace tomofield {
namespace {

namespace fs = std::filesystem;
using testing::ScratchDirectory;

// Two spheres in 13 views of 32 × 128 pixels: two bands of leaves.
TiltSeries two_bands() {
  ViewImages images{.values = {}, .width = 32, .height = 128, .tilt_deg = {}, .pixel_size_A = 5.0};
  const std::vector<simulate::Ellipsoid> bodies{simulate::make_sphere({-4, -30, 1}, 5, 1.0),
                                                simulate::make_sphere({6, 33, -1}, 4, 0.8)};
  for (double tilt = -60; tilt <= 60; tilt += 10) {
    images.tilt_deg.push_back(tilt);
    for (const double value :
         simulate::project_ellipsoids(bodies, {.width = 32, .height = 128, .tilt_deg = tilt}))
      images.values.push_back(static_cast<float>(value));
  }
  return TiltSeries::from_images(std::move(images));
}

Options tiled_options(const fs::path& output) {
  Options options;
  options.views.contrast = Contrast::kBright;
  options.specimen.thickness = 16;
  options.fit.epochs = 2;
  options.fit.coarse_epochs = 2;
  options.fit.penalty = Penalty::kConcave;
  options.fit.fit_view_scale = false;
  options.views.black_level = 0;
  options.views.bead_diameter_nm = 0;
  options.fit.spike_rank = 0;
  options.field.with_margin = false;
  options.field.budget = "0.1dB";
  options.field.tile_rows = 64;
  options.run.output = output;
  return options;
}

bool is_of_first_tile(const Progress& progress) {
  return progress.detail.starts_with("rows 0 to 64");
}
bool is_of_second_tile(const Progress& progress) {
  return progress.detail.starts_with("rows 64 to 128");
}

// Counts the reports of the first tile in a whole run.
int reports_of_first_tile(const TiltSeries& series, const fs::path& output) {
  int count = 0;
  reconstruct(series, tiled_options(output), [&](const Progress& progress) {
    count += is_of_first_tile(progress) ? 1 : 0;
    return true;
  });
  return count;
}

// Makes a run that stops in the second of two tiles.
void stop_in_second_tile(const TiltSeries& series, const Options& options) {
  const auto run = reconstruct(
      series, options, [](const Progress& progress) { return !is_of_second_tile(progress); });
  ASSERT_FALSE(run.is_finished);
}

nlohmann::json tiles_of(const Reconstruction& made) {
  return nlohmann::json::parse(made.metrics)["metrics"].value("tiles", nlohmann::json());
}

TEST(TiledRun, AStopAtTheLastStepOfATileKeepsIt) {
  const ScratchDirectory scratch;
  const TiltSeries series = two_bands();
  const int reports = reports_of_first_tile(series, scratch / "whole.mrc");
  ASSERT_GT(reports, 1);
  Options options = tiled_options(scratch / "stopped.mrc");
  int count = 0;
  const auto stopped = reconstruct(series, options, [&](const Progress& progress) {
    count += is_of_first_tile(progress) ? 1 : 0;
    return count < reports;
  });
  EXPECT_FALSE(stopped.is_finished);
  EXPECT_TRUE(fs::exists(scratch / "stopped_tiles.h5"));
  options.run.resume = true;
  const auto resumed = reconstruct(series, options, [&](const Progress& progress) {
    EXPECT_FALSE(is_of_first_tile(progress));
    return true;
  });
  EXPECT_TRUE(resumed.is_finished);
  EXPECT_EQ(testing::read_whole_file(scratch / "stopped.mrc"),
            testing::read_whole_file(scratch / "whole.mrc"));
}

TEST(TiledRun, ResumesWithTheTilesThatItBeganWith) {
  const ScratchDirectory scratch;
  const TiltSeries series = two_bands();
  Options options = tiled_options(scratch / "volume.mrc");
  stop_in_second_tile(series, options);
  options.run.resume = true;
  options.field.tile_rows = {};  // the memory is enough for the whole region
  const Reconstruction made = reconstruct(series, options);
  EXPECT_EQ(tiles_of(made).size(), 2u);
  EXPECT_FALSE(fs::exists(scratch / "volume_tiles.h5"));
}

TEST(TiledRun, ThatStartsAnewForgetsOldTiles) {
  const ScratchDirectory scratch;
  const TiltSeries series = two_bands();
  Options options = tiled_options(scratch / "volume.mrc");
  stop_in_second_tile(series, options);
  EXPECT_TRUE(fs::exists(scratch / "volume_tiles.h5"));
  options.run.overwrite = true;
  options.fit.seed = 5;
  const auto stop_at_once = [](const Progress&) { return false; };
  EXPECT_FALSE(reconstruct(series, options, stop_at_once).is_finished);
  EXPECT_FALSE(fs::exists(scratch / "volume_tiles.h5"));
  options.run.overwrite = false;
  options.run.resume = true;
  EXPECT_TRUE(reconstruct(series, options).is_finished);
}

TEST(TiledRun, ThatWasStoppedDoesNotKeepAWholeFitFromResuming) {
  const ScratchDirectory scratch;
  const TiltSeries series = two_bands();
  stop_in_second_tile(series, tiled_options(scratch / "other.mrc"));
  Options options = tiled_options(scratch / "volume.mrc");
  options.fit.seed = 5;
  options.field.tile_rows = {};  // the memory is enough for the whole region
  const auto stop_at_once = [](const Progress&) { return false; };
  EXPECT_FALSE(reconstruct(series, options, stop_at_once).is_finished);
  fs::rename(scratch / "other_tiles.h5", scratch / "volume_tiles.h5");
  options.run.resume = true;
  const Reconstruction made = reconstruct(series, options);
  EXPECT_TRUE(made.is_finished);
  EXPECT_TRUE(tiles_of(made).is_null());
}

TEST(TiledRun, RefusesTilesOfAnotherRunBeforeAnyWork) {
  const ScratchDirectory scratch;
  const TiltSeries series = two_bands();
  stop_in_second_tile(series, tiled_options(scratch / "other.mrc"));
  Options options = tiled_options(scratch / "volume.mrc");
  options.fit.seed = 5;
  options.run.resume = true;
  fs::rename(scratch / "other_tiles.h5", scratch / "volume_tiles.h5");
  int num_reports = 0;
  const std::string message = testing::message_of<Error>(
      [&] { reconstruct(series, options, [&](const Progress&) { return ++num_reports > 0; }); });
  EXPECT_NE(message.find("volume_tiles.h5"), std::string::npos) << message;
  EXPECT_NE(message.find("--overwrite"), std::string::npos) << message;
  EXPECT_EQ(num_reports, 0);
}

}  // namespace
}  // namespace tomofield
