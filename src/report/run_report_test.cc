#include "report/run_report.h"

#include <gtest/gtest.h>

#include "io/images/mrc.h"
#include "io/images/png.h"
#include "options/run_options.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

// Returns the record of a fit of two views.
record::FitRecord fit_with(double residual) {
  record::FitRecord fit{.metrics = {}, .verdict = {}, .alignment = {}, .tuned = {}};
  fit.metrics.num_parameters = 100;
  fit.metrics.num_leaves = 1;
  fit.metrics.steps = 4;
  fit.metrics.data_loss = {9.0, residual};
  fit.metrics.stages = {{.field_kind = FieldKind::kGrid, .bin = 1, .first_epoch = 0, .epochs = 2}};
  fit.metrics.seconds = 1.5;
  fit.metrics.threads = 2;
  fit.metrics.threads_why = "2 threads";
  for (const double tilt_deg : {10.0, 20.0})
    fit.metrics.views.push_back({.tilt_deg = tilt_deg,
                                 .scale = 1.0,
                                 .noise_sigma = 2.0,
                                 .residual = residual,
                                 .weight = 1.0});
  fit.metrics.mask.part = {0.0, 0.0};
  fit.verdict.residual = residual;
  fit.verdict.prior.gain = tune::Difference{.log_ratio = -0.04, .standard_error = 0.01};
  fit.verdict.seconds = 7000;
  fit.verdict.peak_GiB = 1.5;
  fit.verdict.warnings = {{.code = "thin", .message = "it seems <thin>"}};
  return fit;
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
    record_.fit = fit_with(1.25);
  }

  std::string page() const {
    return run_report({.record = record_,
                       .files = files_,
                       .options = options_,
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
  record::RunRecord record_;
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

TEST_F(RunReport, ShowsTheDiameterOfBeadsThatWereFound) {
  EXPECT_FALSE(page_has("found in the views"));
  tilt_series::MaskMetrics& masks = record_.fit.metrics.mask.masks;
  masks.num_beads = 8;
  masks.bead_masking = tilt_series::BeadMasking::kMasked;
  masks.bead_diameter_A = 102.5;
  EXPECT_TRUE(page_has("10.2 nm"));
  EXPECT_TRUE(page_has("found in the views"));
  options_.views.bead_diameter_nm = 12;
  EXPECT_FALSE(page_has("found in the views"));
}

TEST_F(RunReport, SaysWhetherTheLearnedPriorHelped) {
  EXPECT_TRUE(page_has("Learned prior"));
  EXPECT_TRUE(page_has("+4.00 % ± 1.00"));
  verdict::PriorSummary& prior = record_.fit.verdict.prior;
  prior = {.is_used = true, .gain = tune::Difference{.log_ratio = 0.013, .standard_error = 0.002}};
  EXPECT_TRUE(page_has("-1.30 % ± 0.20"));
  prior = {};
  EXPECT_FALSE(page_has("Learned prior"));
}

TEST_F(RunReport, ShowsHowFarGoldBeadsLieFromTheirPlacesAndThePose) {
  EXPECT_FALSE(page_has("Gold beads"));
  std::optional<alignment::AlignmentRecord>& found = record_.fit.alignment;
  found = {.is_accepted = true,
           .held_out = {.before = 0.2, .after = 0.1, .gain = {}},
           .beads = alignment::BeadRecord{.num_beads = 12,
                                          .files_px = 1.25,
                                          .before_px = 0.5,
                                          .after_px = 0.25,
                                          .is_accepted = true}};
  for (const double tilt_deg : {10.0, 20.0})
    found->views.push_back({.tilt_deg = tilt_deg,
                            .shift_px = {1.0, 2.0},
                            .agreement = {.correlation = 0.9, .error_px = {0.1, 0.1}}});
  EXPECT_FALSE(page_has("Thickness and pitch"));
  found->pose = {.pose = {.thickness_px = 190.2, .pitch_deg = -4.7, .x_tilt_deg = 1.5},
                 .error = {.thickness_px = 18.0, .pitch_deg = 0.8, .x_tilt_deg = 0.6}};
  EXPECT_TRUE(page_has("190 ± 18 px, -4.7 ± 0.8°, 1.5 ± 0.6°"));
  EXPECT_TRUE(page_has("0.25 px"));
  EXPECT_TRUE(page_has("of the files: 1.25 px"));
  found->is_accepted = false;
  EXPECT_TRUE(page_has("1.25 px"));
  EXPECT_TRUE(page_has("not taken: 0.25 px"));
}

TEST_F(RunReport, ShowsBothHalvesAndTheirCorrelation) {
  record::HalvesRecord& halves = record_.halves.emplace();
  halves.halves[0].fit = fit_with(1.2);
  halves.halves[1].fit = fit_with(1.3);
  halves.fsc.fsc.frequency_per_A = {0.01, 0.02};
  halves.fsc.fsc.all.correlation = {1.0, std::nan("")};
  EXPECT_TRUE(page_has("fitted views, all data"));
  EXPECT_TRUE(page_has("fitted views, even"));
  EXPECT_TRUE(page_has("<h2>Halves</h2>"));
}

}  // namespace
}  // namespace tomofield::report
