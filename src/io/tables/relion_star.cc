#include "io/tables/relion_star.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "io/tables/ctf_table.h"
#include "io/tables/text_lines.h"
#include "io/tables/unknown_entries.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr double kLargestShift_A = base::kLargestPosition_px;
constexpr const char* kNominalTilt = "rlnTomoNominalStageTiltAngle";
constexpr const char* kNominalAxis = "rlnTomoNominalTiltAxisAngle";

// Returns the size of the tomogram. RELION writes three zeros for those that are not reconstructed
// yet, once a table has the columns (MetaDataTable::addLabel).
std::optional<std::array<std::int64_t, 3>> size_of(const StarRow& row, const std::string& where) {
  constexpr std::array kColumns{"rlnTomoSizeX", "rlnTomoSizeY", "rlnTomoSizeZ"};
  std::array<double, 3> pixels{};
  for (std::size_t axis = 0; axis < pixels.size(); ++axis) {
    const auto found = row.find_number(kColumns[axis], base::kLargestPosition_px);
    if (!found) return std::nullopt;
    pixels[axis] = *found;
  }
  if (pixels == std::array{0.0, 0.0, 0.0}) return std::nullopt;
  for (std::size_t axis = 0; axis < pixels.size(); ++axis) {
    if (pixels[axis] >= 1 && pixels[axis] == std::floor(pixels[axis])) continue;
    throw Error(
        fmt::format("{}: _{} is {}, and a tomogram has a whole number of pixels, at least 1: "
                    "correct it, or remove the columns of the size",
                    where, kColumns[axis], pixels[axis]));
  }
  return std::array{static_cast<std::int64_t>(pixels[0]), static_cast<std::int64_t>(pixels[1]),
                    static_cast<std::int64_t>(pixels[2])};
}

// Returns the defocus of a row. Nothing if the table has none, or if one of its numbers is left out
// ("None").
std::optional<Defocus> defocus_of(const StarRow& row, const StarTable& table) {
  const auto u_A = row.find_number("rlnDefocusU", kLargestDefocus_A);
  if (!u_A) return std::nullopt;
  Defocus defocus{*u_A, *u_A, 0.0, 0.0};
  const auto read = [&](const char* column, double largest, double& value) {
    if (!table.has_column(column)) return true;
    const auto found = row.find_number(column, largest);
    value = found.value_or(0.0);
    return found.has_value();
  };
  const bool is_whole = read("rlnDefocusV", kLargestDefocus_A, defocus.v_A) &
                        read("rlnDefocusAngle", base::kLargestAngle_deg, defocus.angle_deg) &
                        read("rlnPhaseShift", base::kLargestAngle_deg, defocus.phase_shift_deg);
  return is_whole ? std::optional(defocus) : std::nullopt;
}

// Returns the pixel size in Å of the images in which a defocus was measured. Gctf writes it as that
// of the detector, in µm, and the magnification.
template <typename Find>
std::optional<double> pixel_size_by(const Find& find) {
  constexpr double kAngstroms_in_um = 1e4;
  for (const char* column : {"rlnMicrographPixelSize", "rlnTomoTiltSeriesPixelSize"})
    if (const auto size_A = find(column)) return size_A;
  const auto detector_um = find("rlnDetectorPixelSize"), magnification = find("rlnMagnification");
  if (!detector_um || !magnification || !(*magnification > 0.0)) return std::nullopt;
  return kAngstroms_in_um * *detector_um / *magnification;
}

// Returns what find(column) finds in the columns of the microscope.
template <typename Find>
StatedOptics optics_by(const Find& find) {
  return {find("rlnVoltage"), find("rlnSphericalAberration"), find("rlnAmplitudeContrast"),
          pixel_size_by(find)};
}

// Returns the number in all rows of all tables that have the column. Throws Error if they differ.
std::optional<double> only_number(const std::filesystem::path& path,
                                  const std::vector<StarTable>& tables, std::string_view column) {
  std::optional<std::optional<double>> only;
  for (const StarTable& table : tables) {
    if (!table.has_column(column)) continue;
    for (std::size_t i = 0; i < table.num_rows(); ++i) {
      const auto number = StarRow(path, table, i).find_number(column);
      if (!only) only = number;
      if (*only == number) continue;
      throw Error(
          fmt::format("'{}': _{} of row {} is another than one before, and a series has one: "
                      "correct it",
                      path.string(), column, i + 1));
    }
  }
  return only.value_or(std::nullopt);
}

// Returns the table that lists views.
const StarTable& rows_of_views(const std::filesystem::path& path,
                               const std::vector<StarTable>& tables) {
  const StarTable* const table = find_only_table(path, tables, "rlnMicrographName");
  if (table != nullptr) return *table;
  if (find_table(tables, "rlnTomoProjX") != nullptr) {
    throw Error(fmt::format(
        "'{}' has projection matrices (_rlnTomoProjX) in place of tilt series, as RELION 4 and "
        "Warp's "
        "export of particles write them: give Warp's XML file or .tomostar, the tomograms.star of "
        "RELION 5, or the stack with --xf and --tlt",
        path.string()));
  }
  if (find_table(tables, "rlnMicrographMovieName") != nullptr) {
    throw Error(fmt::format(
        "'{}' lists movies (_rlnMicrographMovieName), as RELION's job 'Import' writes them: give a "
        "table of the job 'Motion correction' or a later one, which lists images "
        "(_rlnMicrographName)",
        path.string()));
  }
  if (find_table(tables, "rlnTomoTomogramsFile") != nullptr) {
    throw Error(
        fmt::format("'{}' is an optimisation set of RELION: give the tomograms.star that its "
                    "_rlnTomoTomogramsFile names",
                    path.string()));
  }
  throw Error(fmt::format(
      "'{}' has no column _rlnMicrographName, so it is no tilt series of RELION 5", path.string()));
}

StatedOptics optics_of(const std::filesystem::path& path, const std::vector<StarTable>& tables) {
  return optics_by([&](const char* column) { return only_number(path, tables, column); });
}

// Returns the hand of the defocus as a view table has it. RELION adds rlnTomoHand · z to the
// defocus, and z falls to the right at a positive tilt.
std::optional<int> defocus_hand_of(const std::optional<double>& relion_hand,
                                   const std::string& where) {
  if (!relion_hand) return std::nullopt;
  if (*relion_hand == 1.0 || *relion_hand == -1.0) return *relion_hand < 0.0 ? 1 : -1;
  throw Error(fmt::format("{}: _rlnTomoHand is {}, and a hand is 1 or -1: correct it", where,
                          *relion_hand));
}

ListedView view_of(const StarRow& row, const StarTable& table, bool is_nominal) {
  ListedView view;
  view.image = row.text("rlnMicrographName");
  view.even = row.find_text("rlnMicrographNameEven").value_or("");
  view.odd = row.find_text("rlnMicrographNameOdd").value_or("");
  if (is_nominal) {
    view.tilt_deg = row.number(kNominalTilt, base::kLargestAngle_deg);
    view.rotation_deg = row.find_stated_number(kNominalAxis, base::kLargestAngle_deg).value_or(0.0);
  } else {
    view.tilt_deg = row.number("rlnTomoYTilt", base::kLargestAngle_deg);
    view.nominal_tilt_deg = row.find_number(kNominalTilt, base::kLargestAngle_deg);
    view.nominal_axis_deg = row.find_number(kNominalAxis, base::kLargestAngle_deg);
    view.x_tilt_deg = row.find_stated_number("rlnTomoXTilt", base::kLargestAngle_deg).value_or(0.0);
    view.rotation_deg = row.number("rlnTomoZRot", base::kLargestAngle_deg);
    view.shift_x_A = row.number("rlnTomoXShiftAngst", kLargestShift_A);
    view.shift_y_A = row.number("rlnTomoYShiftAngst", kLargestShift_A);
  }
  view.dose_before = row.find_dose("rlnMicrographPreExposure");
  view.defocus = defocus_of(row, table);
  return view;
}

bool is_not_one(const std::string& text) {
  const auto number = parse_number(text);
  return number ? *number != 1.0 : is_not_zero(text);
}

// An optical distortion that a column of RELION states, and that is not applied.
struct Distortion {
  const char* column;
  const char* what;
  bool (*is_set)(const std::string& text);
};

// Returns the distortions that some rows of tables state, for messages. With `row`, that row alone
// counts.
std::vector<std::string> distortions_of(std::span<const StarTable> tables,
                                        std::optional<std::size_t> row = std::nullopt) {
  constexpr std::array<Distortion, 9> kDistortions{
      {{"rlnTomoDeformationCoefficients", "deformations of the views", is_not_zero},
       {"rlnMagMat00", "a magnification matrix", is_not_one},
       {"rlnMagMat11", "a magnification matrix", is_not_one},
       {"rlnMagMat01", "a magnification matrix", is_not_zero},
       {"rlnMagMat10", "a magnification matrix", is_not_zero},
       {"rlnBeamTiltX", "aberrations beside the defocus", is_not_zero},
       {"rlnBeamTiltY", "aberrations beside the defocus", is_not_zero},
       {"rlnOddZernike", "aberrations beside the defocus", is_not_zero},
       {"rlnEvenZernike", "aberrations beside the defocus", is_not_zero}}};
  std::vector<std::string> found;
  for (const Distortion& distortion : kDistortions) {
    const auto states = [&](const StarTable& table) {
      if (!table.has_column(distortion.column)) return false;
      for (std::size_t i = 0; i < table.num_rows(); ++i)
        if ((!row || *row == i) && distortion.is_set(*table.find(i, distortion.column)))
          return true;
      return false;
    };
    if (std::ranges::any_of(tables, states))
      found.push_back(fmt::format("{} (_{})", distortion.what, distortion.column));
  }
  return found;
}

// Notes the first defocus that is left out of a table.
void note_missing_defocus(const StarTable& table, ViewTable& views) {
  if (!table.has_column("rlnDefocusU")) return;
  const auto gap = std::ranges::find_if(
      views.views, [](const ListedView& view) { return !view.defocus.has_value(); });
  if (gap != views.views.end())
    views.ctf_not_applied.push_back(
        fmt::format("no complete defocus in row {}", gap - views.views.begin() + 1));
}

// Remarks on the columns of all tables that are not known.
void note_unknown_columns(const std::vector<StarTable>& tables, ViewTable& views) {
  std::vector<std::string> unknown;
  for (const StarTable& table : tables)
    for (const std::string& column : unknown_columns(table, known_view_columns()))
      unknown.push_back(column);
  if (const auto remark = remark_on_unknown(unknown)) views.remarks.push_back(*remark);
}

// Throws Error if a table beside that of the tomograms states something of them.
void require_one_table(const std::filesystem::path& path, const std::vector<StarTable>& tables,
                       const StarTable& of_tomograms) {
  for (const StarTable& other : tables)
    for (const char* column :
         {"rlnVoltage", "rlnSphericalAberration", "rlnAmplitudeContrast",
          "rlnTomoTiltSeriesPixelSize", "rlnTomoHand", "rlnTomoDefocusSlope", "rlnMtfFileName"})
      if (&other != &of_tomograms && other.has_column(column))
        throw Error(
            fmt::format("'{}' states _{} in its table 'data_{}', and RELION has it in that of the "
                        "tomograms, 'data_{}': move it there, or leave it out",
                        path.string(), column, other.name(), of_tomograms.name()));
}

}  // namespace

bool lists_tomograms(const std::filesystem::path& path) {
  return find_table(read_star_file(path), "rlnTomoTiltSeriesStarFile") != nullptr;
}

RelionTomograms read_relion_tomograms(const std::filesystem::path& path) {
  const std::vector<StarTable> tables = read_star_file(path);
  const StarTable* const table = find_only_table(path, tables, "rlnTomoTiltSeriesStarFile");
  if (table == nullptr) {
    throw Error(
        fmt::format("'{}' has no column _rlnTomoTiltSeriesStarFile, so it is no "
                    "tomograms.star of RELION 5 (those of RELION 4 are not read)",
                    path.string()));
  }
  require_one_table(path, tables, *table);
  RelionTomograms all{
      *table, {}, remark_on_unknown(unknown_columns(*table, known_tomogram_columns()))};
  for (std::size_t i = 0; i < table->num_rows(); ++i) {
    const StarRow row(path, *table, i);
    RelionTomogram tomogram;
    tomogram.name = row.text("rlnTomoName");
    tomogram.tilt_series_star = row.text("rlnTomoTiltSeriesStarFile");
    tomogram.pixel_size_A = row.find_number("rlnTomoTiltSeriesPixelSize");
    const std::string where = fmt::format("'{}', tomogram {}", path.string(), quote(tomogram.name));
    tomogram.defocus_hand = defocus_hand_of(row.find_number("rlnTomoHand"), where);
    tomogram.defocus_slope = row.find_number("rlnTomoDefocusSlope");
    tomogram.optics = optics_by([&](const char* column) { return row.find_number(column); });
    tomogram.recorded_pixel_A = row.find_number("rlnMicrographOriginalPixelSize");
    tomogram.mtf = row.find_text("rlnMtfFileName").value_or("");
    tomogram.not_applied = distortions_of({table, 1}, i);
    tomogram.size_px = size_of(row, where);
    if (!tomogram.size_px && row.find_number("rlnTomoSizeZ").value_or(0.0) > 0.0)
      tomogram.not_applied.emplace_back("rlnTomoSizeZ without rlnTomoSizeX and rlnTomoSizeY");
    all.tomograms.push_back(std::move(tomogram));
  }
  if (all.tomograms.empty())
    throw Error(fmt::format("'{}' lists no tomograms: its table is empty", path.string()));
  return all;
}

StarTable read_relion_rows(const std::filesystem::path& path) {
  return rows_of_views(path, read_star_file(path));
}

void set_relion_alignment(const ListedView& view, std::size_t row, StarTable& table) {
  const auto set = [&](const char* column, double value) {
    table.set(row, column, fmt::format("{:.6f}", value));
  };
  set("rlnTomoXTilt", view.x_tilt_deg);
  set("rlnTomoYTilt", view.tilt_deg);
  set("rlnTomoZRot", view.rotation_deg);
  set("rlnTomoXShiftAngst", view.shift_x_A);
  set("rlnTomoYShiftAngst", view.shift_y_A);
}

ViewTable read_relion_views(const std::filesystem::path& path) {
  const std::vector<StarTable> tables = read_star_file(path);
  const StarTable& table = rows_of_views(path, tables);
  const bool is_nominal = !table.has_column("rlnTomoYTilt") && table.has_column(kNominalTilt);
  if (!table.has_column("rlnTomoYTilt") && !is_nominal) {
    throw Error(
        fmt::format("'{}' has no column _rlnTomoYTilt, so the tilt series is not aligned "
                    "yet: give the table that RELION's job 'Align tilt-series' wrote",
                    path.string()));
  }
  ViewTable views;
  views.file = path;
  views.centre = CentreRule::kWholePixel;
  views.is_nominal = is_nominal;
  views.optics = optics_of(path, tables);
  for (std::size_t i = 0; i < table.num_rows(); ++i)
    views.views.push_back(view_of(StarRow(path, table, i), table, is_nominal));
  views.not_applied = distortions_of(tables);
  views.defocus_hand =
      defocus_hand_of(only_number(path, tables, "rlnTomoHand"), fmt::format("'{}'", path.string()));
  note_missing_defocus(table, views);
  note_unknown_columns(tables, views);
  return views;
}

CtfTable read_relion_ctf(const std::filesystem::path& path) {
  const std::vector<StarTable> tables = read_star_file(path);
  const StarTable* const table = find_only_table(path, tables, "rlnDefocusU");
  if (table == nullptr) {
    throw Error(fmt::format(
        "'{}' has no column _rlnDefocusU: give the table of a tilt series that RELION's "
        "job 'CTF estimation' or a later one wrote",
        path.string()));
  }
  CtfTable ctf{path, {}, optics_of(path, tables), distortions_of(tables)};
  ctf.defocus_hand =
      defocus_hand_of(only_number(path, tables, "rlnTomoHand"), fmt::format("'{}'", path.string()));
  for (std::size_t i = 0; i < table->num_rows(); ++i) {
    const StarRow row(path, *table, i);
    ctf.views.push_back(defocus_of(row, *table));
    if (const auto image = row.find_text("rlnMicrographName")) ctf.images.push_back(*image);
    ctf.dose_before.push_back(row.find_dose("rlnMicrographPreExposure"));
    ctf.tilt_deg.push_back(
        row.find_number("rlnTomoNominalStageTiltAngle", base::kLargestAngle_deg));
    if (!ctf.tilt_deg.back())
      ctf.tilt_deg.back() = row.find_number("rlnTomoYTilt", base::kLargestAngle_deg);
  }
  return ctf;
}

}  // namespace tomofield::io
