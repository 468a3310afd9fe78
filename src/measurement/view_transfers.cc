#include "measurement/view_transfers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "base/log.h"
#include "io/images/mrc_format.h"
#include "io/tables/alignment_files.h"
#include "io/tables/ctf_table.h"
#include "io/tables/mtf_table.h"
#include "io/tables/view_table.h"
#include "measurement/section_exposures.h"
#include "measurement/section_rows.h"
#include "tilt_series/match_by_tilt.h"
#include "tilt_series/planned_series.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

constexpr double kAngstroms_in_um = 1e4;

void tell_of_missing_ctf(const SeriesFiles& files) {
  const auto target_um =
      files.mdoc ? io::target_underfocus_um(io::read_mdoc(*files.mdoc)) : std::nullopt;
  base::log_info(fmt::format(
      "ctf: none is given (--ctf or --defocus), so the views count as plain projections: "
      "a tomogram of them lacks contrast at low resolution and keeps the fringes of defocus{}",
      target_um ? fmt::format("; the target of the .mdoc would be --defocus {}", *target_um)
      : io::without_half(files.stack) != files.stack
          ? fmt::format("; that of the table would be --ctf {}",
                        io::without_half(files.stack).string())
          : ""));
}

// Throws Error if the pixel size is the one that stands for an unknown one.
void require_pixel_size(const tilt_series::TiltSeriesOptions& input,
                        const tilt_series::PlannedSeries& series, const std::string& stack) {
  const double unbinned_A = series.pixel_size_A() / series.bin_factor();
  if (input.pixel_size_A || std::abs(unbinned_A - 1.0) > 1e-6) return;
  throw Error(
      fmt::format("contrast transfer and dose depend on the pixel size, which '{}' does not "
                  "have: give it with --pixel-size",
                  stack));
}

Sections sections_of(const tilt_series::TiltSeriesOptions& input,
                     const tilt_series::PlannedSeries& series) {
  const io::ImageStack& stack = series.stack();
  Sections sections{input, stack.name(), stack.header().nz, {}, {}};
  for (std::int64_t i = 0; i < sections.count && !stack.is_in_memory(); ++i)
    sections.images.push_back(stack.image_name(i));
  sections.tilt_deg.resize(static_cast<std::size_t>(sections.count));
  for (const tilt_series::View& view : series.views())
    sections.tilt_deg[static_cast<std::size_t>(view.section)] =
        view.tilt_deg - input.tilt_offset_deg;
  return sections;
}

// Puts the views of a table of IMOD that ends early in their places by tilt, if it is of other
// views than the first ones. As in IMOD, the views beside them have the defocus of the nearest one.
// Returns false if the tilts do not tell.
bool place_by_tilt(const Sections& sections, io::CtfTable& table) {
  const auto is_stated = [](const auto& tilt) { return tilt.has_value(); };
  const auto matched = std::ranges::all_of(table.tilt_deg, is_stated)
                           ? tilt_series::match_by_tilt(table.tilt_deg, sections.tilt_deg)
                           : std::nullopt;
  if (!matched) return false;
  std::map<std::size_t, io::Defocus> of_section;
  for (std::size_t row = 0; row < matched->size(); ++row)
    if (table.views[row]) of_section[*(*matched)[row]] = *table.views[row];
  std::vector<std::optional<io::Defocus>> views;
  for (std::size_t i = 0; i < sections.tilt_deg.size(); ++i) {
    const auto after = of_section.upper_bound(i);
    views.emplace_back(after == of_section.begin() ? after->second : std::prev(after)->second);
  }
  table.views = std::move(views);
  table.tilt_deg.clear();
  return true;
}

// Adds the views that a table of IMOD leaves out, to the last of which its last defocus goes on.
void extend(const Sections& sections, io::CtfTable& table) {
  const auto count = static_cast<std::size_t>(sections.count);
  if (!table.goes_on || table.views.size() >= count) return;
  if (place_by_tilt(sections, table)) return;
  table.views.resize(count, table.views.back());
  table.tilt_deg.resize(count);
}

// Puts the rows of a table of contrast transfer into the order of the sections. Those of the table
// that lists the images are in their order.
void match_sections(const Sections& sections, io::CtfTable& table) {
  const SeriesFiles& files = sections.input;
  std::error_code absent;
  if (!sections.input.images && io::is_view_table(files.stack) &&
      std::filesystem::equivalent(io::without_half(files.stack), table.file, absent)) {
    table.tilt_deg.clear();
    table.images.clear();
  }
  const auto count = static_cast<std::size_t>(sections.count);
  extend(sections, table);
  const RowOfSection rows =
      rows_of_sections(sections, {table.file, /*is_ctf=*/true, table.is_of_aretomo,
                                  table.views.size(), table.tilt_deg, table.images});
  std::vector<std::optional<io::Defocus>> matched(count);
  for (std::size_t i = 0; i < count; ++i)
    if (rows[i]) matched[i] = table.views[*rows[i]];
  table.views = std::move(matched);
}

// Warns of a defocus that no image for phase contrast has, as of a file in another unit or of a
// failed fit.
void warn_of_unusual_defocus(const Sections& sections, const io::CtfTable& table) {
  constexpr base::Interval kUsual_A{1000.0, 250'000.0};
  const auto unusual = [&](const io::Defocus& defocus) -> std::optional<double> {
    for (const double value_A : {defocus.u_A, defocus.v_A})
      if (!kUsual_A.find(value_A)) return value_A;
    return std::nullopt;
  };
  std::size_t count = 0, first = 0;
  for (std::size_t i = 0; i < table.views.size(); ++i) {
    if (!table.views[i] || !sections.tilt_deg[i] || !unusual(*table.views[i])) continue;
    if (count++ == 0) first = i;
  }
  if (count == 0) return;
  base::log_warning(fmt::format(
      "{} has a defocus of {:.4g} Å in section {}, and one outside {:g} to {:g} Å in {} of its "
      "sections: is it under focus, and in the right unit? ({} goes on without it)",
      table.file.empty() ? "--defocus" : fmt::format("'{}'", table.file.string()),
      *unusual(*table.views[first]), first + 1, kUsual_A.low(), kUsual_A.high(), count,
      table.file.empty() ? "a run without --defocus" : "--ctf none"));
}

// Returns the contrast transfer of each section, or nothing without any.
std::optional<io::CtfTable> find_ctf(const SeriesFiles& files, const ViewOptions& options,
                                     const Sections& sections) {
  if (const auto& um = options.defocus_um) {
    const double defocus_A = *um * kAngstroms_in_um;
    io::CtfTable table;
    table.views.assign(static_cast<std::size_t>(sections.count),
                       io::Defocus{defocus_A, defocus_A, 0.0, 0.0});
    base::log_info(fmt::format("ctf: an underfocus of {} µm in all views", *um));
    warn_of_unusual_defocus(sections, table);
    return table;
  }
  if (!has_ctf_file(files)) return std::nullopt;
  io::CtfTable table = io::read_ctf(*files.ctf);
  match_sections(sections, table);
  warn_of_unusual_defocus(sections, table);
  for (const std::string& what : table.not_applied)
    base::log_warning(fmt::format("'{}' has {}, which is not applied", table.file.string(), what));
  base::log_info(fmt::format("ctf: the defocus of each view from '{}'; --ctf none turns it off",
                             table.file.string()));
  if (table.defocus_hand && options.defocus_hand && *table.defocus_hand != *options.defocus_hand)
    base::log_warning(
        fmt::format("'{}' states the other hand of the defocus, {}, than the one that counts, {}: "
                    "give the right one with --defocus-hand",
                    table.file.string(), *table.defocus_hand, *options.defocus_hand));
  if (table.defocus_hand && !options.defocus_hand)
    base::log_info(
        fmt::format("ctf: --defocus-hand {} from '{}'", *table.defocus_hand, table.file.string()));
  return table;
}

// Returns the voltage that an .mdoc states, if there is one.
std::optional<double> voltage_of_mdoc(const SeriesFiles& files) {
  return files.mdoc ? io::read_mdoc(*files.mdoc).voltage_kV : std::nullopt;
}

constexpr double kSameVoltage_kV = 1.0;

// A number of the microscope for messages: its name, its unit, the option that sets it, and the
// difference up to which two are the same.
struct OpticsName {
  std::string_view what, unit, option;
  double same;
};

// Says so if a file states another number of the microscope than the one that counts.
void warn_of_other_optics(const std::filesystem::path& file, const std::optional<double>& stated,
                          double used, const OpticsName& name) {
  if (!stated || std::fabs(*stated - used) <= name.same) return;
  base::log_warning(
      fmt::format("'{}' has the defocus for {} of {}{}, and {}{} count: give the right one with {}",
                  file.string(), name.what, *stated, name.unit, used, name.unit, name.option));
}

// Says so if the defocus was measured with another pixel size, which makes it wrong by the square.
// Images are also binned by whole numbers, which changes no defocus.
void warn_of_pixels(double pixel_size_A, const io::CtfTable& ctf) {
  constexpr double kCalibration = 0.02;
  const double stated_A = ctf.optics.pixel_size_A.value_or(0.0);
  if (stated_A <= 0.0) return;
  const double ratio = std::max(stated_A, pixel_size_A) / std::min(stated_A, pixel_size_A);
  if (std::fabs(ratio / std::round(ratio) - 1.0) < kCalibration) return;
  base::log_warning(fmt::format(
      "'{}' has the defocus for pixels of {:.6g} Å, and the pixels of the views have {:.6g} Å: a "
      "defocus that was measured with a wrong size is wrong by its square",
      ctf.file.string(), stated_A, pixel_size_A));
}

// Returns the optics: those of the options, else those of the file, else the usual ones. The
// voltage is also that of an .mdoc.
microscope::Optics find_optics(const SeriesFiles& files, const ViewOptions& options,
                               const std::optional<io::CtfTable>& ctf,
                               const tilt_series::PlannedSeries& series) {
  const io::StatedOptics stated = ctf ? ctf->optics : io::StatedOptics{};
  microscope::Optics optics;
  const auto choose = [](double& value, const std::optional<double>& given,
                         const std::optional<double>& in_file) {
    if (given || in_file) value = given ? *given : *in_file;
  };
  const std::optional<double>& in_header_kV = series.stack().header().extended_voltage_kV;
  const std::optional<double> in_mdoc_kV = voltage_of_mdoc(files);
  const std::optional<double>& recorded_kV = in_mdoc_kV ? in_mdoc_kV : in_header_kV;
  const std::string recorded_in =
      in_mdoc_kV ? files.mdoc->string() : "the header of " + series.stack().name();
  if (in_mdoc_kV && in_header_kV && std::fabs(*in_mdoc_kV - *in_header_kV) > kSameVoltage_kV)
    base::log_warning(fmt::format(
        "'{}' states a voltage of {} kV, and the header of '{}' {} kV: give the right one with "
        "--voltage",
        recorded_in, *in_mdoc_kV, series.stack().name(), *in_header_kV));
  choose(optics.voltage_kV, options.voltage_kV, recorded_kV ? recorded_kV : stated.voltage_kV);
  if (recorded_kV && std::fabs(*recorded_kV - optics.voltage_kV) > kSameVoltage_kV)
    base::log_warning(fmt::format("'{}' states a voltage of {} kV, and {} kV count (--voltage)",
                                  recorded_in, *recorded_kV, optics.voltage_kV));
  if (!options.voltage_kV && recorded_kV)
    base::log_info(fmt::format("voltage: {} kV from '{}'", *recorded_kV, recorded_in));
  if (!ctf) return microscope::without_phase_contrast(optics);
  warn_of_other_optics(ctf->file, stated.voltage_kV, optics.voltage_kV,
                       {"a voltage", " kV", "--voltage", kSameVoltage_kV});
  warn_of_pixels(series.pixel_size_A() / series.bin_factor(), *ctf);
  choose(optics.spherical_aberration_mm, options.spherical_aberration_mm,
         stated.spherical_aberration_mm);
  choose(optics.amplitude_contrast, options.amplitude_contrast, stated.amplitude_contrast);
  warn_of_other_optics(ctf->file, stated.spherical_aberration_mm, optics.spherical_aberration_mm,
                       {"a spherical aberration", " mm", "--cs",
                        0.001 * std::max(optics.spherical_aberration_mm, 1.0)});
  warn_of_other_optics(ctf->file, stated.amplitude_contrast, optics.amplitude_contrast,
                       {"an amplitude contrast", "", "--amplitude-contrast", 0.001});
  return optics;
}

// Returns what the detector passes of the signal, or nothing if it is not known.
std::shared_ptr<const microscope::Detector> find_detector(
    const SeriesFiles& files, const tilt_series::PlannedSeries& series) {
  if (!files.mtf) return nullptr;
  io::MtfTable mtf = io::read_mtf(*files.mtf);
  base::log_info(
      fmt::format("mtf: what the detector passes of the signal, from '{}'", files.mtf->string()));
  return std::make_shared<microscope::Detector>(
      microscope::Detector{std::move(mtf), series.pixel_size_A() / series.bin_factor()});
}

// Sets the defocus of a view, turned to the aligned image, and its slope over that image.
void set_defocus(const ViewOptions& options, int hand, const tilt_series::PlannedSeries& series,
                 std::size_t view, const io::CtfTable& ctf, microscope::ViewTransfer& transfer) {
  const tilt_series::View& of = series.views()[view];
  const std::optional<io::Defocus>& recorded = ctf.views[static_cast<std::size_t>(of.section)];
  if (!recorded)
    throw Error(
        fmt::format("'{}' has no defocus of section {}: add it, or leave the section out "
                    "with --exclude {}",
                    ctf.file.string(), of.section + 1, of.section + 1));
  const bool is_right = options.defocus_hand.value_or(ctf.defocus_hand.value_or(hand)) > 0;
  const auto side = is_right ? microscope::DefocusHand::kRight : microscope::DefocusHand::kLeft;
  transfer.defocus = microscope::aligned_defocus(*recorded, series.raw_from_aligned(view));
  transfer.slope = microscope::slope_of_tilt(of.tilt_deg, series.pixel_size_A(), side);
  transfer.is_flipped = options.is_phase_flipped;
}

// Refuses a contrast transfer that spreads detail over more pixels than the view has.
void require_rings(const tilt_series::PlannedSeries& series, const tilt_series::View& view,
                   const microscope::ViewTransfer& transfer) {
  const double largest_A =
      std::max(std::fabs(transfer.defocus.u_A), std::fabs(transfer.defocus.v_A));
  const double spread_px = microscope::spread_px(transfer);
  const auto side = static_cast<double>(std::max(series.width(), series.height()));
  if (spread_px <= side) return;
  throw Error(fmt::format(
      "the defocus of {:.4g} µm of section {} and the spherical aberration of {:g} mm "
      "spread detail over {:.3g} of its pixels of {:.4g} Å, and the view has {}: check "
      "the defocus, --cs and the pixel size, or correct no contrast transfer (--ctf none, "
      "without --defocus)",
      largest_A * 1e-4, view.section + 1, transfer.optics.spherical_aberration_mm, spread_px,
      transfer.pixel_size_A, side));
}

// Warns of corrections that a stack has had, as its labels say, and that are applied all the same.
void warn_of_labels(const io::ImageStack& stack, bool corrects_ctf, bool corrects_dose,
                    bool corrects_detector) {
  if (corrects_detector && io::is_in_labels(stack.header(), "inverse of mtf"))
    base::log_warning(fmt::format(
        "'{}' was filtered by the inverse of the detector's transfer function (mtffilter), as its "
        "header says, and --mtf divides by it again: leave --mtf out",
        stack.name()));
  if (corrects_ctf && io::is_phase_flipped(stack.header()))
    base::log_warning(fmt::format(
        "'{}' went through ctfphaseflip, as its header says, and its views count as not corrected: "
        "give --ctf-phase-flipped",
        stack.name()));
  if (corrects_dose && io::is_dose_weighted(stack.header()))
    base::log_warning(fmt::format(
        "'{}' is weighted by the dose already, as its header says, and its views count as not "
        "weighted: give --dose-weighted",
        stack.name()));
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
                                                     const tilt_series::PlannedSeries& series) {
  const SeriesFiles& files = input;
  const ViewOptions& options = input;
  if (!has_ctf(files, options) && !files.ctf && options.contrast == Contrast::kDark)
    tell_of_missing_ctf(files);
  if (!wants_transfers(files, options)) return {};
  const Sections sections = sections_of(input, series);
  require_pixel_size(input, series, sections.stack);
  const auto ctf = find_ctf(files, options, sections);
  const auto exposures = find_exposures(files, options, sections);
  const auto detector = find_detector(files, series);
  warn_of_labels(series.stack(), ctf && !options.is_phase_flipped, exposures.has_value(),
                 detector != nullptr);
  if (!ctf && !exposures && !detector) return {};
  const microscope::Optics optics = find_optics(files, options, ctf, series);
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
