#include "measurement/view_transfers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "base/log.h"
#include "io/tables/alignment_files.h"
#include "io/tables/ctf_table.h"
#include "io/tables/mtf_table.h"
#include "io/tables/view_table.h"
#include "microscope/exposure.h"
#include "tilt_series/open_views.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

using microscope::Exposure;
using Exposures = std::vector<Exposure>;  // [section]

constexpr double kAngstroms_in_um = 1e4;

// Throws Error if the pixel size is the one that stands for an unknown one.
void require_pixel_size(const tilt_series::TiltSeriesOptions& input,
                        const tilt_series::TiltSeries& series, const std::string& stack) {
  const double unbinned_A = series.pixel_size_A() / series.bin_factor();
  if (input.pixel_size_A || std::abs(unbinned_A - 1.0) > 1e-6) return;
  throw Error(
      fmt::format("contrast transfer and dose depend on the pixel size, which '{}' does not "
                  "have: give it with --pixel-size",
                  stack));
}

void require_sections(std::size_t count, std::int64_t num_sections,
                      const std::filesystem::path& file, const char* what,
                      const std::string& stack) {
  if (static_cast<std::int64_t>(count) == num_sections) return;
  throw Error(
      fmt::format("'{}' has the {} of {} sections, but '{}' has {}: give the file of this stack",
                  file.string(), what, count, stack, num_sections));
}

// Returns the contrast transfer of each section, or nothing without any.
std::optional<io::CtfTable> find_ctf(const SeriesFiles& files, const ViewOptions& options,
                                     std::int64_t num_sections, const std::string& stack) {
  if (const auto& um = options.defocus_um) {
    const double defocus_A = *um * kAngstroms_in_um;
    io::CtfTable table;
    table.views.assign(static_cast<std::size_t>(num_sections),
                       io::Defocus{defocus_A, defocus_A, 0.0, 0.0});
    base::log_info(fmt::format("ctf: an underfocus of {} µm in all views", *um));
    return table;
  }
  if (!has_ctf_file(files)) return std::nullopt;
  io::CtfTable table = io::read_ctf(*files.ctf);
  require_sections(table.views.size(), num_sections, table.file, "contrast transfer", stack);
  for (const std::string& what : table.not_applied)
    base::log_warning(fmt::format("'{}' has {}, which is not applied", table.file.string(), what));
  base::log_info(fmt::format("ctf: the defocus of each view from '{}'; --ctf none turns it off",
                             table.file.string()));
  return table;
}

// Returns the optics: those of the options, else those of the file, else the usual ones.
microscope::Optics find_optics(const ViewOptions& options, const std::optional<io::CtfTable>& ctf) {
  const io::StatedOptics stated = ctf ? ctf->optics : io::StatedOptics{};
  microscope::Optics optics;
  const auto choose = [](double& value, const std::optional<double>& given,
                         const std::optional<double>& in_file) {
    if (given || in_file) value = given ? *given : *in_file;
  };
  choose(optics.voltage_kV, options.voltage_kV, stated.voltage_kV);
  if (!ctf) return microscope::without_phase_contrast(optics);
  choose(optics.spherical_aberration_mm, options.spherical_aberration_mm,
         stated.spherical_aberration_mm);
  choose(optics.amplitude_contrast, options.amplitude_contrast, stated.amplitude_contrast);
  return optics;
}

// What files say of the doses and of the order in which the sections were recorded.
struct Recording {
  std::string source;              // the name of the file; empty: no file tells
  std::optional<Exposures> doses;  // [section]
  std::vector<std::size_t> order;  // of sections
};

// Returns the sections in the order of their exposures.
std::vector<std::size_t> order_of(const Exposures& exposures) {
  std::vector<std::size_t> order(exposures.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return exposures[i].before; });
  return order;
}

Recording find_recording(const SeriesFiles& files, const tilt_series::TiltSeriesOptions& input,
                         std::int64_t num_sections, const std::string& stack) {
  Recording found;
  if (files.mdoc) {
    const io::Mdoc mdoc = io::read_mdoc(*files.mdoc);
    require_sections(mdoc.sections.size(), num_sections, *files.mdoc, "doses", stack);
    return {files.mdoc->string(), microscope::exposures_of(mdoc), io::acquisition_order(mdoc)};
  }
  if (!input.images && io::is_view_table(files.stack)) {
    found.doses = microscope::exposures_of(io::read_view_table(files.stack));
    if (found.doses) {
      require_sections(found.doses->size(), num_sections, files.stack, "doses", stack);
      return {files.stack.string(), found.doses, order_of(*found.doses)};
    }
  }
  found.order.resize(static_cast<std::size_t>(num_sections));
  std::iota(found.order.begin(), found.order.end(), std::size_t{0});
  return found;
}

// Returns the exposure of each section, or nothing if it is not known or not wanted.
std::optional<Exposures> find_exposures(const SeriesFiles& files, const ViewOptions& options,
                                        const tilt_series::TiltSeriesOptions& input,
                                        std::int64_t num_sections, const std::string& stack) {
  const std::optional<double>& of_view = options.dose_per_tilt;
  if (options.is_dose_weighted) {
    base::log_info("dose: the views are weighted by it already, so no radiation damage is applied");
    return std::nullopt;
  }
  if (of_view && *of_view == 0.0) return std::nullopt;
  const Recording recording = find_recording(files, input, num_sections, stack);
  if (!of_view) {
    if (recording.doses) base::log_info(fmt::format("dose: from '{}'", recording.source));
    return recording.doses;
  }
  base::log_info(fmt::format(
      "dose: {} electrons per Å² a view, in the order of {}", *of_view,
      recording.source.empty() ? "the stack's sections, because no file has the order of recording"
                               : "'" + recording.source + "'"));
  return microscope::exposures_in_order(recording.order, *of_view);
}

// Returns what the detector passes of the signal, or nothing if it is not known.
std::shared_ptr<const microscope::Detector> find_detector(const SeriesFiles& files,
                                                          const tilt_series::TiltSeries& series) {
  if (!files.mtf) return nullptr;
  io::MtfTable mtf = io::read_mtf(*files.mtf);
  base::log_info(
      fmt::format("mtf: what the detector passes of the signal, from '{}'", files.mtf->string()));
  return std::make_shared<microscope::Detector>(
      microscope::Detector{std::move(mtf), series.pixel_size_A() / series.bin_factor()});
}

// Sets the defocus of a view, turned to the aligned image, and its slope over that image.
void set_defocus(const ViewOptions& options, int hand, const tilt_series::TiltSeries& series,
                 std::size_t view, const io::CtfTable& ctf, microscope::ViewTransfer& transfer) {
  const tilt_series::View& of = series.views()[view];
  const std::optional<io::Defocus>& recorded = ctf.views[static_cast<std::size_t>(of.section)];
  if (!recorded)
    throw Error(
        fmt::format("'{}' has no defocus of section {}: add it, or leave the section out "
                    "with --exclude {}",
                    ctf.file.string(), of.section + 1, of.section + 1));
  const bool is_right = options.defocus_hand.value_or(hand) > 0;
  const auto side = is_right ? microscope::DefocusHand::kRight : microscope::DefocusHand::kLeft;
  transfer.defocus = microscope::aligned_defocus(*recorded, series.raw_from_aligned(view));
  transfer.slope = microscope::slope_of_tilt(of.tilt_deg, series.pixel_size_A(), side);
  transfer.is_flipped = options.is_phase_flipped;
}

// Refuses a contrast transfer that spreads detail over more pixels than the view has: its rings are
// too narrow to be told apart, and no correction means anything (Crowther et al. 1996).
void require_rings(const tilt_series::TiltSeries& series, const tilt_series::View& view,
                   const microscope::ViewTransfer& transfer) {
  const double largest_A =
      std::max(std::fabs(transfer.defocus.u_A), std::fabs(transfer.defocus.v_A));
  const double pixel_A = transfer.pixel_size_A;
  const double spread_px = microscope::electron_wavelength_A(transfer.optics.voltage_kV) *
                           largest_A / (2.0 * pixel_A * pixel_A);
  const auto side = static_cast<double>(std::max(series.width(), series.height()));
  if (spread_px <= side) return;
  throw Error(
      fmt::format("the defocus of {:.4g} µm of section {} spreads detail over {:.3g} of its pixels "
                  "of {:.4g} Å, "
                  "and the view has {}: check the defocus and the pixel size, or give --ctf none",
                  largest_A * 1e-4, view.section + 1, spread_px, pixel_A, side));
}

}  // namespace

std::vector<const char*> faults_of_transfer(const SeriesFiles& files, const ViewOptions& options) {
  std::vector<const char*> all;
  const auto refuse_if = [&](bool is_fault, const char* sentence) {
    if (is_fault) all.push_back(sentence);
  };
  refuse_if(has_ctf_file(files) && options.defocus_um,
            "--ctf and --defocus both set the defocus of the views: give one of them");
  refuse_if(
      !has_ctf(files, options) && !files.ctf &&
          (options.is_phase_flipped || options.defocus_hand || options.spherical_aberration_mm ||
           options.amplitude_contrast),
      "--ctf-phase-flipped, --defocus-hand, --cs and --amplitude-contrast describe a contrast "
      "transfer: give --ctf or --defocus as well");
  refuse_if(options.dose_per_tilt.value_or(0.0) > 0.0 && options.is_dose_weighted,
            "--dose-weighted says that the damage of --dose-per-tilt is in the views already: give "
            "one of them");
  return all;
}

std::vector<microscope::ViewTransfer> view_transfers(const tilt_series::TiltSeriesOptions& input,
                                                     int hand,
                                                     const tilt_series::TiltSeries& series) {
  const SeriesFiles& files = input;
  const ViewOptions& options = input;
  if (!has_ctf(files, options) && !files.ctf && options.contrast == Contrast::kDark)
    base::log_info(
        "ctf: none is given (--ctf or --defocus), so the views count as plain projections: "
        "a tomogram of them lacks contrast at low resolution and keeps the fringes of defocus");
  if (!wants_transfers(files, options)) return {};
  const auto stack = tilt_series::open_views(input);
  const std::int64_t num_sections = stack->header().nz;
  require_pixel_size(input, series, stack->name());
  const auto ctf = find_ctf(files, options, num_sections, stack->name());
  const auto exposures = find_exposures(files, options, input, num_sections, stack->name());
  const auto detector = find_detector(files, series);
  if (!ctf && !exposures && !detector) return {};
  const microscope::Optics optics = find_optics(options, ctf);
  std::vector<microscope::ViewTransfer> transfers(series.views().size());
  for (std::size_t view = 0; view < transfers.size(); ++view) {
    microscope::ViewTransfer& transfer = transfers[view];
    const auto section = static_cast<std::size_t>(series.views()[view].section);
    transfer.optics = optics;
    transfer.pixel_size_A = series.pixel_size_A();
    transfer.detector = detector;
    if (exposures) transfer.exposure = (*exposures)[section].at_middle();
    if (!ctf) continue;
    set_defocus(options, hand, series, view, *ctf, transfer);
    require_rings(series, series.views()[view], transfer);
  }
  return transfers;
}

}  // namespace tomofield::measurement
