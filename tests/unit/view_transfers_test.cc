#include "measurement/view_transfers.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "expect_parts.h"
#include "options/run_options.h"
#include "scratch_directory.h"
#include "simulate/simulate_series.h"
#include "tomofield/error.h"
#include "warning_catcher.h"

namespace tomofield::measurement {
namespace {

using microscope::ViewTransfer;
using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

simulate::SimulationOptions simulation() {
  simulate::SimulationOptions options;
  options.cell.size_px = 32;
  options.cell.thickness_px = 12;
  options.tilts = {-40, 40, 20};
  options.voxel_size_A = 8.0;
  options.imaging.defocus = simulate::Imaging::Range{3.0, 5.0};
  options.imaging.astigmatism_um = 0.2;
  options.imaging.dose_per_tilt = 3.0;
  options.write_truth = false;
  return options;
}

SeriesFiles files_in(const ScratchDirectory& folder) {
  SeriesFiles files;
  files.stack = folder / "s/tilt_series.mrc";
  files.tlt = folder / "s/tilt_series.tlt";
  return files;
}

Options options_of_run() {
  Options options;
  options.views.contrast = Contrast::kBright;
  options.specimen.thickness = 12;
  return options;
}

std::vector<ViewTransfer> transfers_of(const SeriesFiles& files, const Options& options) {
  const options::ReconstructOptions run = options::run_options(files, options);
  return measurement::view_transfers(run.input(), run.specimen.hand,
                                     tilt_series::TiltSeries(run.input()));
}

void expect_same(const ViewTransfer& a, const ViewTransfer& b) {
  EXPECT_DOUBLE_EQ(a.optics.voltage_kV, b.optics.voltage_kV);
  EXPECT_DOUBLE_EQ(a.optics.spherical_aberration_mm, b.optics.spherical_aberration_mm);
  EXPECT_DOUBLE_EQ(a.optics.amplitude_contrast, b.optics.amplitude_contrast);
  EXPECT_NEAR(a.defocus.u_A, b.defocus.u_A, 1e-3);
  EXPECT_NEAR(a.defocus.v_A, b.defocus.v_A, 1e-3);
  EXPECT_NEAR(a.defocus.angle_deg, b.defocus.angle_deg, 1e-6);
  EXPECT_NEAR(a.slope.at(7, 5), b.slope.at(7, 5), 1e-3);
  EXPECT_NEAR(a.exposure, b.exposure, 1e-6);
  EXPECT_NEAR(a.pixel_size_A, b.pixel_size_A, 1e-6);
  EXPECT_EQ(a.is_flipped, b.is_flipped);
}

TEST(ViewTransfers, AreThoseThatASeriesWasSimulatedWith) {
  const ScratchDirectory folder;
  const simulate::SimulationOptions simulated = simulation();
  simulate::simulate_series(folder / "s", simulated, false);
  const auto views = simulate::plan_views(simulated);
  for (const char* ctf : {"s/tilt_series_ctf.txt", "s/tilt_series.defocus"}) {
    SeriesFiles files = files_in(folder);
    files.ctf = folder / ctf;
    files.mdoc = folder / "s/tilt_series.mdoc";
    const auto transfers = transfers_of(files, options_of_run());
    ASSERT_EQ(transfers.size(), views.size());
    for (std::size_t i = 0; i < views.size(); ++i) {
      expect_same(transfers[i],
                  simulate::transfer_of({.width = 32,
                                         .height = 32,
                                         .tilt_deg = views[i].tilt_deg,
                                         .raw_from_aligned = views[i].raw_from_aligned,
                                         .warp = {}},
                                        simulated.imaging, views[i].defocus,
                                        views[i].exposure.at_middle(), simulated.voxel_size_A));
    }
  }
}

TEST(ViewTransfers, FollowTheOptions) {
  const ScratchDirectory folder;
  simulate::simulate_series(folder / "s", simulation(), false);
  SeriesFiles files = files_in(folder);
  Options options = options_of_run();
  EXPECT_TRUE(transfers_of(files, options).empty());
  options.views.dose_per_tilt = 2.0;  // and no order but that of the stack
  EXPECT_EQ(transfers_of(files, options).back().exposure, 9.0);
  EXPECT_EQ(transfers_of(files, options).back().optics.amplitude_contrast, 1.0);
  options.views.exclude = "1";
  options.views.defocus_um = 4.0;
  options.views.is_phase_flipped = true;
  options.views.voltage_kV = 200.0;
  options.specimen.hand = -1;
  const auto transfers = transfers_of(files, options);
  ASSERT_EQ(transfers.size(), 4u);
  EXPECT_EQ(transfers[0].exposure, 3.0);  // of the second section
  EXPECT_EQ(transfers[0].defocus.u_A, 4e4);
  EXPECT_EQ(transfers[0].optics.voltage_kV, 200.0);
  EXPECT_TRUE(transfers[0].is_flipped);
  EXPECT_GT(transfers[0].slope.x_A, 0.0);  // at −20°, mirrored
  options.views.defocus_hand = 1;          // mirrored or not
  EXPECT_LT(transfers_of(files, options)[0].slope.x_A, 0.0);
  EXPECT_EQ(transfers[0].detector, nullptr);
  files.mtf = folder.write("mtf.star",
                           "data_\nloop_\n_rlnResolutionInversePixel #1\n_rlnMtfValue #2\n"
                           "0 1\n0.5 0.25\n");
  options.views.bin = 2;
  const auto binned = transfers_of(files, options);
  EXPECT_NEAR(binned[0].detector->transfer(0.5 / binned[0].pixel_size_A), 0.625, 1e-9);
}

TEST(ViewTransfers, AreRefusedWithoutWhatTheyNeed) {
  const ScratchDirectory folder;
  simulate::SimulationOptions simulated = simulation();
  simulate::simulate_series(folder / "s", simulated, false);
  simulated.tilts.last_deg = 20;
  simulate::simulate_series(folder / "fewer", simulated, false);
  SeriesFiles files = files_in(folder);
  files.ctf = folder / "fewer/tilt_series_ctf.txt";
  expect_parts(message_of<Error>([&] { transfers_of(files, options_of_run()); }),
               {"fewer/tilt_series_ctf.txt", "4 sections", "has 5"});
  simulated = simulation();
  simulated.voxel_size_A = 1.0;
  simulated.imaging = {};
  simulate::simulate_series(folder / "plain", simulated, false);
  files.stack = folder / "plain/tilt_series.mrc";
  files.ctf.reset();
  Options options = options_of_run();
  options.views.defocus_um = 4.0;
  expect_parts(message_of<Error>([&] { transfers_of(files, options); }),
               {"plain/tilt_series.mrc", "pixel size", "--pixel-size"});
}

TEST(ViewTransfers, OpticsThatContradictOrCannotBeAreWarnedOf) {
  const ScratchDirectory folder;
  simulate::simulate_series(folder / "s", simulation(), false);
  SeriesFiles files = files_in(folder);
  const auto warnings = [&](const Options& options) {
    const testing::WarningCatcher caught;
    transfers_of(files, options);
    return caught.text();
  };
  Options options = options_of_run();
  options.views.defocus_um = 3e-6;  // metres, say
  expect_parts(warnings(options), {"--defocus", "right unit"});
  options.views.defocus_um.reset();
  files.ctf = folder / "s/tilt_series_ctf.txt";
  EXPECT_EQ(warnings(options), "");
  options.views.spherical_aberration_mm = 0.01;
  options.views.amplitude_contrast = 0.5;
  expect_parts(warnings(options), {"spherical aberration", "--cs", "--amplitude-contrast"});
  options = options_of_run();
  files.ctf = folder.write("a.defocus", "1 0 0. 0. 0 3\n1 5 0 0 0.3 2900 0\n");
  expect_parts(warnings(options), {"a.defocus", "right unit", "5 of its sections"});
}

// Returns a table of RELION's or Gctf's form without tilts; `images` are the images of its rows.
std::string table_of(const std::vector<std::string>& images) {
  std::string text =
      "data_\nloop_\n_rlnMicrographName #1\n_rlnDefocusU #2\n_rlnDefocusV #3\n"
      "_rlnDefocusAngle #4\n_rlnMicrographPreExposure #5\n";
  for (std::size_t i = 0; i < images.size(); ++i)
    text += fmt::format("{0} {1}0000 {1}0000 0 {2}\n", images[i], 1 + i, 3 * i);
  return text;
}

// Returns the names of some sections of a stack.
std::vector<std::string> sections_of(const std::string& stack, const std::vector<int>& numbers) {
  std::vector<std::string> names;
  for (const int number : numbers) names.push_back(fmt::format("{:06d}@{}", number, stack));
  return names;
}

TEST(ViewTransfers, RowsAreThoseOfTheImagesThatTheyName) {
  const ScratchDirectory folder;
  simulate::SimulationOptions simulated = simulation();
  simulated.imaging.dose_per_tilt = 0;
  simulate::simulate_series(folder / "s", simulated, false);
  SeriesFiles files = files_in(folder);
  std::string said;
  const auto defoci_um = [&](const std::string& table) {
    files.ctf = folder.write("a.star", table);
    const testing::WarningCatcher caught;
    std::vector<double> found;
    for (const ViewTransfer& transfer : transfers_of(files, options_of_run()))
      found.push_back(transfer.defocus.u_A / 1e4);
    said = caught.text();
    return found;
  };
  const std::vector<double> in_order{1, 2, 3, 4, 5}, reversed{5, 4, 3, 2, 1};
  EXPECT_EQ(defoci_um(table_of(sections_of("a/tilt_series.st", {1, 2, 3, 4, 5}))), in_order);
  EXPECT_EQ(defoci_um(table_of(sections_of("tilt_series.mrc", {5, 4, 3, 2, 1}))), reversed);
  EXPECT_EQ(said, "");
  EXPECT_EQ(defoci_um(table_of(sections_of("TS_07.mrc", {5, 4, 3, 2, 1}))), reversed);
  expect_parts(said, {"a.star", "other images", "TS_07.mrc", "by the numbers"});
  EXPECT_EQ(defoci_um(table_of({"a.mrc", "b.mrc", "c.mrc", "d.mrc", "e.mrc"})), in_order);
  expect_parts(said, {"a.star", "other images", "a.mrc", "in their order"});
}

TEST(ViewTransfers, DosesOfATableForTheContrastTransferCount) {
  const ScratchDirectory folder;
  simulate::simulate_series(folder / "s", simulation(), false);
  SeriesFiles files = files_in(folder);
  files.ctf = folder.write("a.star", table_of(sections_of("tilt_series", {3, 2, 4, 1, 5})));
  const auto exposures = [&](const Options& options) {
    std::vector<double> found;
    for (const ViewTransfer& transfer : transfers_of(files, options))
      found.push_back(transfer.exposure);
    return found;
  };
  Options options = options_of_run();
  EXPECT_EQ(exposures(options), (std::vector<double>{10.5, 4.5, 1.5, 7.5, 13.5}));
  options.views.dose_per_tilt = 2.0;  // in the order of the table
  EXPECT_EQ(exposures(options), (std::vector<double>{7, 3, 1, 5, 9}));
  options.views.dose_per_tilt = 0.0;
  EXPECT_EQ(exposures(options), (std::vector<double>{0, 0, 0, 0, 0}));
}

TEST(ViewTransfers, AnMdocWithoutDosesHidesNoOthers) {
  const ScratchDirectory folder;
  simulate::simulate_series(folder / "s", simulation(), false);
  SeriesFiles files = files_in(folder);
  files.ctf = folder.write("a.star", table_of(sections_of("tilt_series", {3, 2, 4, 1, 5})));
  std::string sections = "Voltage = 200\n";
  for (int i = 0; i < 5; ++i)
    sections += fmt::format("[ZValue = {}]\nTiltAngle = {}\n", i, 40 - 20 * i);
  files.mdoc = folder.write("a.mdoc", sections);
  Options options = options_of_run();
  EXPECT_EQ(transfers_of(files, options)[0].exposure, 10.5);
  options.views.dose_per_tilt = 2.0;
  EXPECT_EQ(transfers_of(files, options)[0].exposure, 7.0);
  options.views.voltage_kV = 300.0;  // as a project may state it
  const testing::WarningCatcher caught;
  transfers_of(files, options);
  expect_parts(caught.text(), {"a.mdoc", "200 kV", "300 kV count"});
}

TEST(ViewTransfers, TheHandOfATableForTheContrastTransferCounts) {
  const ScratchDirectory folder;
  simulate::simulate_series(folder / "s", simulation(), false);
  SeriesFiles files = files_in(folder);
  const auto slope = [&](const char* inverted, const Options& options) {
    files.ctf = folder.write(
        "a.xml", fmt::format("<TiltSeries AreAnglesInverted=\"{}\"><Angles>40\n20\n0\n-20\n-40"
                             "</Angles><MoviePath>a\nb\nc\nd\ne</MoviePath><GridCTF Width=\"1\" "
                             "Height=\"1\" Depth=\"1\"><Node X=\"0\" Y=\"0\" Z=\"0\" "
                             "Value=\"3\"/></GridCTF></TiltSeries>",
                             inverted));
    return transfers_of(files, options)[0].slope.x_A;
  };
  Options options = options_of_run();
  EXPECT_EQ(slope("True", options), -slope("False", options));
  EXPECT_NE(slope("True", options), 0.0);
  const double of_true = slope("True", options);
  options.views.defocus_hand = 1;
  EXPECT_EQ(slope("True", options), of_true);
  EXPECT_EQ(slope("False", options), of_true);
}

TEST(ViewTransfers, ContradictionsAreFaults) {
  const auto num_faults = [](const Options& options, const char* ctf) {
    SeriesFiles files;
    if (ctf != nullptr) files.ctf = ctf;
    return options::run_options(files, options).faults().size();
  };
  Options options = options_of_run();
  EXPECT_EQ(num_faults(options, "a.defocus"), 0u);
  options.views.defocus_um = 3.0;
  EXPECT_EQ(num_faults(options, "none"), 0u);
  EXPECT_EQ(num_faults(options, "a.defocus"), 1u);
  options.fit.engine = Engine::kRay;
  EXPECT_EQ(num_faults(options, nullptr), 1u);
  options = options_of_run();
  options.views.is_phase_flipped = true;
  EXPECT_EQ(num_faults(options, nullptr), 1u);
  options = options_of_run();
  options.views.dose_per_tilt = 3.0;
  options.views.is_dose_weighted = true;
  EXPECT_EQ(num_faults(options, nullptr), 1u);
}

}  // namespace
}  // namespace tomofield::measurement
