#include "measurement/section_exposures.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <string>
#include <utility>

#include "base/log.h"
#include "io/tables/alignment_files.h"
#include "io/tables/ctf_table.h"
#include "io/tables/view_table.h"
#include "measurement/view_transfers.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

// Holds what files say of the doses and of the order in which the sections were recorded.
struct Recording {
  std::filesystem::path file;
  std::optional<Exposures> doses;               // [row]
  std::vector<std::size_t> order;               // of rows
  std::vector<std::optional<double>> tilt_deg;  // [row]; empty: not in the file
  std::vector<std::string> images = {};         // [row]; empty: not in the file
  bool has_order = true;                        // the file states the order
};

// Returns the sections in the order of their exposures.
std::vector<std::size_t> order_of(const Exposures& exposures) {
  std::vector<std::size_t> order(exposures.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return exposures[i].before; });
  return order;
}

// Reads the doses of an .mdoc. With `of_view`, the order of recording alone counts.
Recording recording_of_mdoc(const std::filesystem::path& path, bool of_view) {
  const io::Mdoc mdoc = io::read_mdoc(path);
  const io::AcquisitionOrder order = io::acquisition_order(mdoc);
  Recording found{path, {}, order.sections, {}};
  found.has_order = order.is_stated;
  for (const io::MdocSection& section : mdoc.sections) found.tilt_deg.push_back(section.tilt_deg);
  if (of_view) {
    if (!order.fault_of_times.empty()) {
      throw Error(
          fmt::format("'{}': {}, so --dose-per-tilt has no order of recording: complete DateTime, "
                      "or leave --mdoc out if the stack is in that order",
                      path.string(), order.fault_of_times));
    }
    if (microscope::contradicts_prior_doses(found.order, mdoc)) {
      throw Error(fmt::format(
          "'{}': PriorRecordDose is missing in some sections and contradicts the order of the "
          "others, so --dose-per-tilt has no order of recording: complete PriorRecordDose or "
          "DateTime, or leave --mdoc out if the stack is in that order",
          path.string()));
    }
    return found;
  }
  microscope::StatedExposures doses = microscope::exposures_of(mdoc);
  if (!doses.fault.empty()) {
    base::log_warning(
        fmt::format("'{}': {}, so its doses are not used ({})", path.string(), doses.fault,
                    order.fault_of_times.empty() ? "--dose-per-tilt gives a dose"
                                                 : "complete DateTime; or, if the stack is in the "
                                                   "order of recording, leave the .mdoc out "
                                                   "and give --dose-per-tilt"));
  }
  found.doses = std::move(doses.of_view);
  return found;
}

// Returns the exposures that a file states. Warns if they are not known, and --dose-per-tilt
// (`of_view`) does not replace them.
std::optional<Exposures> known_exposures(microscope::StatedExposures stated,
                                         const std::filesystem::path& file, bool of_view) {
  if (!stated.fault.empty() && !of_view)
    base::log_warning(
        fmt::format("'{}': {}, so its doses are not used (--dose-per-tilt gives a dose)",
                    file.string(), stated.fault));
  return std::move(stated.of_view);
}

// Reads the doses and the order of recording of a list of tilts, if it has them.
std::optional<Recording> recording_of_tilts(const std::filesystem::path& path, bool of_view) {
  const io::TiltTable table = io::read_tilt_table(path);
  if (table.order.empty()) return std::nullopt;
  Recording found{path, {}, table.order, {}};
  for (const io::NumberLine& angle : table.angles) found.tilt_deg.emplace_back(angle.value);
  if (!table.doses.empty())
    found.doses = known_exposures(microscope::exposures_of(table), path, of_view);
  return found;
}

// Reads the doses and the order that a table of views states which is given for its contrast
// transfer.
std::optional<Recording> recording_of_ctf(const std::filesystem::path& path, bool of_view) {
  const io::CtfTable ctf = io::read_ctf(path);
  io::ViewTable table;
  for (const std::optional<double>& dose : ctf.dose_before) {
    table.views.emplace_back();
    table.views.back().dose_before = dose;
  }
  const auto doses = known_exposures(microscope::exposures_of(table), path, of_view);
  if (!doses) return std::nullopt;
  return Recording{path, doses, order_of(*doses), ctf.tilt_deg, ctf.images};
}

// Returns the recording by the tables of views and tilts, if one has it.
std::optional<Recording> recording_of_tables(const SeriesFiles& files, const Sections& sections,
                                             bool of_view) {
  if (!sections.input.images && io::is_view_table(files.stack)) {
    const auto doses = known_exposures(microscope::exposures_of(io::read_view_table(files.stack)),
                                       io::without_half(files.stack), of_view);
    if (doses) return Recording{files.stack, doses, order_of(*doses), {}};
  }
  if (files.tlt)
    if (auto found = recording_of_tilts(*files.tlt, of_view)) return found;
  return has_ctf_file(files) ? recording_of_ctf(*files.ctf, of_view) : std::nullopt;
}

// Returns the first recording that has what is wanted: doses, or with --dose-per-tilt an order.
std::optional<Recording> find_recording(const SeriesFiles& files, const Sections& sections,
                                        bool of_view) {
  if (!files.mdoc) return recording_of_tables(files, sections, of_view);
  Recording of_mdoc = recording_of_mdoc(*files.mdoc, of_view);
  if (of_view ? of_mdoc.has_order : of_mdoc.doses.has_value()) return of_mdoc;
  auto found = recording_of_tables(files, sections, of_view);
  return found ? found : of_mdoc;
}

// Refuses exposures in which no specimen keeps a signal.
void require_bearable(const Exposures& exposures, const std::string& source) {
  constexpr double kMost = 2000;  // ten times a usual series
  double all = 0.0;
  for (const microscope::Exposure& exposure : exposures)
    all = std::max(all, exposure.before + exposure.of_view);
  if (all <= kMost) return;
  throw Error(fmt::format(
      "the doses of {} add up to {:g} electrons per Å², and at most {:g} are allowed, because late "
      "views would have no signal: give the dose of one view, or --dose-per-tilt 0 to leave the "
      "radiation damage out",
      source, all, kMost));
}

}  // namespace

std::optional<Exposures> find_exposures(const SeriesFiles& files, const ViewOptions& options,
                                        const Sections& sections) {
  const std::optional<double>& of_view = options.dose_per_tilt;
  if (options.is_dose_weighted) {
    base::log_info("dose: the views are weighted by it already, so no radiation damage is applied");
    return std::nullopt;
  }
  if (of_view && *of_view == 0.0) return std::nullopt;
  const auto recording = find_recording(files, sections, of_view.has_value());
  if (!recording) {
    if (!of_view) return std::nullopt;
    base::log_info(fmt::format(
        "dose: {} electrons per Å² a view, in the order of the stack's sections, because "
        "no file has the order of recording",
        *of_view));
    std::vector<std::size_t> as_stacked(static_cast<std::size_t>(sections.count));
    std::iota(as_stacked.begin(), as_stacked.end(), std::size_t{0});
    const Exposures of_section = microscope::exposures_in_order(as_stacked, *of_view);
    require_bearable(of_section, "--dose-per-tilt");
    return of_section;
  }
  if (!of_view && !recording->doses) return std::nullopt;
  base::log_info(of_view ? fmt::format("dose: {} electrons per Å² a view, in the order of '{}'",
                                       *of_view, recording->file.string())
                         : fmt::format("dose: from '{}'", recording->file.string()));
  const Exposures of_row =
      of_view ? microscope::exposures_in_order(recording->order, *of_view) : *recording->doses;
  require_bearable(of_row,
                   of_view ? "--dose-per-tilt" : fmt::format("'{}'", recording->file.string()));
  const auto rows = rows_of_sections(sections, {.file = recording->file,
                                                .count = of_row.size(),
                                                .tilt_deg = recording->tilt_deg,
                                                .images = recording->images});
  Exposures of_section(static_cast<std::size_t>(sections.count));
  for (std::size_t i = 0; i < of_section.size(); ++i)
    if (rows[i]) of_section[i] = of_row[*rows[i]];
  return of_section;
}

}  // namespace tomofield::measurement
