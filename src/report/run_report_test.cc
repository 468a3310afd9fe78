#include "report/run_report.h"

#include <gtest/gtest.h>

#include "io/images/mrc.h"
#include "io/images/png.h"
#include "options/run_options.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

using nlohmann::json;

// Returns the metrics of a fit of two views, as output::metrics_json() and others write them.
json metrics_of_fit(double residual) {
  const auto view = [&](double tilt_deg) {
    return json{{"tilt_deg", tilt_deg}, {"scale", 1.0},  {"offset", 0.0},
                {"noise_sigma", 2.0},   {"weight", 1.0}, {"residual", residual}};
  };
  return {{"views", {view(10), view(20)}},
          {"mean_squared_residual_per_noise_variance", {9.0, residual}},
          {"held_out", nullptr},
          {"tuning", nullptr},
          {"mask",
           {{"beads", 0},
            {"bead_masking", "none"},
            {"bad_pixels", 0},
            {"masked_part", 0.0},
            {"views", json::array()}}},
          {"stages", json::array({{{"epochs", 2}, {"bin", 1}, {"field", "grid"}}})},
          {"threads", 2},
          {"threads_why", "2 threads"},
          {"steps", 4},
          {"parameters", 100},
          {"seconds", 1.5},
          {"leaves", 1},
          {"verdict",
           {{"residual", residual},
            {"held_out", nullptr},
            {"prior", {{"learned", false}, {"gain", -0.04}, {"standard_error", 0.01}}},
            {"views", nullptr},
            {"seconds", 7000},
            {"peak_GiB", 1.5},
            {"warnings", json::array({{{"code", "thin"}, {"message", "it seems <thin>"}}})}}}};
}

class RunReport : public ::testing::Test {
 protected:
  RunReport() {
    io::MrcWriter writer(
        directory_ / "volume.mrc",
        {.nx = 4, .ny = 3, .nz = 2, .voxel_size_A = {8.0, 8.0, 8.0}, .labels = {}});
    for (int z = 0; z < 2; ++z)
      writer.write_section(z, std::vector<float>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
    writer.close();
    io::write_png_grey(directory_ / "mask.png", 2, 2, std::vector<std::uint8_t>{0, 1, 2, 3});
    files_.stack = "series.mrc";
    options_.specimen.thickness = 2;
    record_ = {{"options", options::options_json(options::run_options(files_, options_))},
               {"metrics", metrics_of_fit(1.25)}};
  }

  std::string page() const {
    return run_report({.record = record_,
                       .files = files_,
                       .options = options_,
                       .alignment = alignment_,
                       .volume = directory_ / "volume.mrc",
                       .pictures = {.mask = directory_ / "mask.png",
                                    .tree = {},
                                    .held_out = {},
                                    .dial = {},
                                    .prior = {}}});
  }
  bool page_has(const std::string& text) const { return page().find(text) != std::string::npos; }

  const testing::ScratchDirectory directory_;
  SeriesFiles files_;
  Options options_;
  std::optional<alignment::AlignmentRecord> alignment_;
  json record_;
};

TEST_F(RunReport, ShowsWarningsAndNumbers) {
  EXPECT_TRUE(page_has("One warning"));
  EXPECT_TRUE(page_has("It seems &lt;thin&gt;."));
  EXPECT_TRUE(page_has("<b>4 × 3 × 2</b>"));
  EXPECT_TRUE(page_has("Tilts from 10.0° to 20.0°."));
  EXPECT_TRUE(page_has("1.9 h, 1.5 GiB"));
  EXPECT_TRUE(page_has("CTF and dose"));
  EXPECT_FALSE(page_has("even half"));
}

TEST_F(RunReport, SaysWhetherTheLearnedPriorHelped) {
  EXPECT_TRUE(page_has("Learned prior"));
  EXPECT_TRUE(page_has("+4.00 % ± 1.00"));
  json& prior = record_["metrics"]["verdict"]["prior"];
  prior = {{"learned", true}, {"gain", 0.013}, {"standard_error", 0.002}};
  EXPECT_TRUE(page_has("-1.30 % ± 0.20"));
  prior = {{"learned", false}, {"gain", nullptr}, {"standard_error", nullptr}};
  EXPECT_FALSE(page_has("Learned prior"));
}

TEST_F(RunReport, ShowsHowFarGoldBeadsLieFromTheirPlacesAndThePose) {
  EXPECT_FALSE(page_has("Gold beads"));
  alignment_ = {.is_accepted = true,
                .held_out = {.before = 0.2, .after = 0.1, .gain = {}},
                .beads = alignment::BeadRecord{.num_beads = 12,
                                               .files_px = 1.25,
                                               .before_px = 0.5,
                                               .after_px = 0.25,
                                               .is_accepted = true}};
  for (const double tilt_deg : {10.0, 20.0})
    alignment_->views.push_back({.tilt_deg = tilt_deg,
                                 .shift_px = {1.0, 2.0},
                                 .agreement = {.correlation = 0.9, .error_px = {0.1, 0.1}}});
  EXPECT_FALSE(page_has("Thickness and pitch"));
  alignment_->pose = {.pose = {.thickness_px = 190.2, .pitch_deg = -4.7},
                      .error = {.thickness_px = 18.0, .pitch_deg = 0.8}};
  EXPECT_TRUE(page_has("190 ± 18 px, -4.7 ± 0.8°"));
  EXPECT_TRUE(page_has("0.25 px"));
  EXPECT_TRUE(page_has("of the files: 1.25 px"));
  alignment_->is_accepted = false;
  EXPECT_TRUE(page_has("1.25 px"));
  EXPECT_TRUE(page_has("not taken: 0.25 px"));
}

TEST_F(RunReport, ShowsBothHalvesAndTheirCorrelation) {
  record_["halves"] = {
      {"fsc", {{"frequency_per_A", {0.01, 0.02}}, {"all", {{"correlation", {1.0, nullptr}}}}}},
      {"even", {{"metrics", metrics_of_fit(1.2)}}},
      {"odd", {{"metrics", metrics_of_fit(1.3)}}}};
  EXPECT_TRUE(page_has("fitted views, all data"));
  EXPECT_TRUE(page_has("fitted views, even"));
  EXPECT_TRUE(page_has("<h2>Halves</h2>"));
}

}  // namespace
}  // namespace tomofield::report
