#include "exchange/particles/particle_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "base/log.h"
#include "base/plausible.h"
#include "io/tables/fiducial_points.h"
#include "output/model_input_record.h"
#include "output/volume_frame.h"
#include "tomofield/error.h"

namespace tomofield::exchange {
namespace {

namespace fs = std::filesystem;
using field::Point;

constexpr const char* kTomogramName = "rlnTomoName";
constexpr const char* kOpticsGroup = "rlnOpticsGroup";
constexpr const char* kSeriesPixel = "rlnTomoTiltSeriesPixelSize";
constexpr std::array kCoordinates{"rlnCenteredCoordinateXAngst", "rlnCenteredCoordinateYAngst",
                                  "rlnCenteredCoordinateZAngst"};
constexpr std::array kAngles{"rlnAngleRot", "rlnAngleTilt", "rlnAnglePsi"};
constexpr std::array kSubtomogramAngles{"rlnTomoSubtomogramRot", "rlnTomoSubtomogramTilt",
                                        "rlnTomoSubtomogramPsi"};

// RELION counts from a point that is half an unbinned pixel above the middle of our volume.
constexpr double kCentre_px = 0.5;

/// Returns the size of an unbinned pixel of the series, as far as the options of the run tell.
double unbinned_pixel_A(const output::ModelInfo& model) {
  return model.pixel_size_A / output::input_of(model).bin;
}

/// Returns the name of the tomogram whose particles are wanted: the given one, or that of the
/// model's file. It is empty if there is neither.
std::string wanted_name(const fs::path& model_file, const std::string& tomogram) {
  return tomogram.empty() ? model_file.stem().string() : tomogram;
}

void require_name(const std::string& wanted) {
  if (wanted.empty())
    throw Error("a model in memory has no name: give that of its tomogram (--tomogram)");
}

// ------------------------------------------------------------------ RELION

/// Says whose particles are taken, where the list does not only name the tomogram that is wanted.
void tell_choice(const fs::path& path, std::size_t num_rows, std::size_t num_taken,
                 const std::string& only, const std::string& wanted) {
  if (num_taken < num_rows) {
    base::log_info(
        fmt::format("{} of the {} particles of '{}' are of '{}'; the others are left out",
                    num_taken, num_rows, path.string(), wanted));
  } else if (!only.empty() && !wanted.empty() && only != wanted) {
    base::log_warning(
        fmt::format("all particles of '{}' are of '{}', and the model is called '{}': they are "
                    "taken for its own",
                    path.string(), only, wanted));
  }
}

/// Returns the rows of the tomogram.
std::vector<std::size_t> rows_of_tomogram(const fs::path& path, const io::StarTable& table,
                                          const fs::path& model_file, const std::string& tomogram) {
  std::vector<std::size_t> rows;
  std::set<std::string> names;
  for (std::size_t row = 0; row < table.num_rows(); ++row)
    names.insert(table.find(row, kTomogramName).value_or(""));
  const bool is_only = names.size() == 1 && tomogram.empty();
  const std::string wanted = wanted_name(model_file, tomogram);
  if (!is_only) require_name(wanted);
  for (std::size_t row = 0; row < table.num_rows(); ++row)
    if (is_only || table.find(row, kTomogramName).value_or("") == wanted) rows.push_back(row);
  if (!rows.empty()) {
    tell_choice(path, table.num_rows(), rows.size(), *names.begin(), wanted);
    return rows;
  }
  if (names.empty()) throw Error(fmt::format("'{}' has no particles", path.string()));
  std::string first = "'" + *names.begin() + "'";
  if (names.size() > 1) first += fmt::format(" to '{}'", *names.rbegin());
  throw Error(
      fmt::format("'{}' has particles of {} tomogram{} ({}), and none of '{}': name one "
                  "with --tomogram",
                  path.string(), names.size(), names.size() == 1 ? "" : "s", first, wanted));
}

/// Returns the pixel size of the tilt series from which a particle comes.
std::optional<double> series_pixel_A(const fs::path& path, const io::StarTable& optics,
                                     const std::optional<std::string>& group) {
  for (std::size_t row = 0; row < optics.num_rows(); ++row) {
    if (group && optics.num_rows() > 1 && optics.find(row, kOpticsGroup) != group) continue;
    const auto size_A = io::StarRow(path, optics, row).find_stated_number(kSeriesPixel);
    if (!size_A || base::is_plausible_pixel_size(*size_A)) return size_A;
    throw Error(fmt::format("'{}': _{} is {} Å, and pixels have {} to {} Å", path.string(),
                            kSeriesPixel, *size_A, base::kPixelSizes_A.low(),
                            base::kPixelSizes_A.high()));
  }
  return std::nullopt;
}

bool are_other_pixels(double stated_A, double of_model_A) {
  constexpr double kCalibration = 0.02;
  return std::fabs(stated_A - of_model_A) > kCalibration * of_model_A;
}

/// Returns the rotation that three angles of a row state. As in RELION, one that is not stated is
/// 0.
field::Rotation rotation_of(const io::StarRow& row, const std::array<const char*, 3>& columns) {
  const auto angle = [&](const char* column) {
    return row.find_stated_number(column).value_or(0.0);
  };
  return field::rotation_from_euler(angle(columns[0]), angle(columns[1]), angle(columns[2]));
}

/// Returns a particle whose coordinates count from `centre`, a point of the volume.
Particle relion_particle(const io::StarRow& row, const Point& centre, double pixel_A,
                         double unbinned_A) {
  constexpr double kLargest_A = 1e8;
  Particle particle{.place_px = centre};
  for (std::size_t a = 0; a < 3; ++a)
    particle.place_px[a] +=
        (row.number(kCoordinates[a], kLargest_A) + kCentre_px * unbinned_A) / pixel_A;
  particle.volume_from_box = rotation_of(row, kSubtomogramAngles);
  return particle;
}

ParticleList read_relion(const fs::path& path, const fs::path& model_file,
                         const output::ModelInfo& model, const std::string& tomogram) {
  const std::vector<io::StarTable> tables = io::read_star_file(path);
  const io::StarTable* const all = io::find_only_table(path, tables, kCoordinates[0]);
  if (all == nullptr) {
    throw Error(fmt::format("'{}' has no column _{}, which the particles of RELION 5 have{}",
                            path.string(), kCoordinates[0],
                            io::find_table(tables, "rlnCoordinateX") != nullptr
                                ? ": its _rlnCoordinateX is of RELION 4; import the particles into "
                                  "RELION 5, or give their voxels as the text of model2point"
                                : ""));
  }
  ParticleList list;
  list.table = all->only(rows_of_tomogram(path, *all, model_file, tomogram));
  if (const auto optics = std::ranges::find(tables, "optics", &io::StarTable::name);
      optics != tables.end())
    list.optics = *optics;
  const Point centre = output::VolumeFrame(model).centre();
  const double of_model_A = unbinned_pixel_A(model);
  bool is_warned = false;
  for (std::size_t row = 0; row < list.table.num_rows(); ++row) {
    const auto of_series_A = series_pixel_A(path, list.optics, list.table.find(row, kOpticsGroup));
    if (!is_warned && of_series_A && are_other_pixels(*of_series_A, of_model_A)) {
      is_warned = true;
      base::log_warning(fmt::format(
          "'{}' states pixels of {:.6g} Å for the tilt series (_{}), and the model's series has "
          "{:.6g} Å: coordinates count from the centre by the former",
          path.string(), *of_series_A, kSeriesPixel, of_model_A));
    }
    list.particles.push_back(relion_particle(io::StarRow(path, list.table, row), centre,
                                             model.pixel_size_A, of_series_A.value_or(of_model_A)));
  }
  return list;
}

// -------------------------------------------------------------------- IMOD

ParticleList read_points(const fs::path& path, const fs::path& model_file,
                         const output::ModelInfo& model, const std::string& tomogram) {
  const std::string name = wanted_name(model_file, tomogram);
  require_name(name);
  const double unbinned_A = unbinned_pixel_A(model);
  const Point centre = output::VolumeFrame(model).centre();
  std::vector<std::string> columns{kTomogramName};
  columns.insert(columns.end(), kCoordinates.begin(), kCoordinates.end());
  columns.insert(columns.end(), kAngles.begin(), kAngles.end());
  columns.push_back(kOpticsGroup);
  ParticleList list;
  list.optics = {"optics", {kOpticsGroup, "rlnOpticsGroupName", kSeriesPixel}};
  list.optics.add_row({"1", name, fmt::format("{:.6f}", unbinned_A)});
  list.table = {"particles", columns};
  const bool is_xzy = output::axes_of_tomogram(model) == VolumeAxes::kXzy;
  if (is_xzy)
    base::log_info(fmt::format(
        "'{}' counts along x, z, y, as the tomogram was written (--axes xzy)", path.string()));
  const double thickness = model.geometry.thickness, nz = std::floor(thickness);
  for (const io::FiducialPoint& point : io::read_fiducial_points(path, "particles")) {
    // The rows of a section along y count down from the upper face.
    const double y = is_xzy ? point.section + 0.5 : point.y_px;
    const double z = is_xzy ? nz - point.y_px : point.section + 0.5;
    const Point place{static_cast<double>(model.roi.x0) + point.x_px,
                      static_cast<double>(model.roi.y0) + y, z + (thickness - nz) / 2};
    std::vector<std::string> row{name};
    for (std::size_t a = 0; a < 3; ++a)
      row.push_back(fmt::format(
          "{:.4f}", (place[a] - centre[a]) * model.pixel_size_A - kCentre_px * unbinned_A));
    row.insert(row.end(), {"0.0", "0.0", "0.0", "1"});
    list.table.add_row(std::move(row));
    list.particles.push_back({.place_px = place});
  }
  return list;
}

}  // namespace

ParticleList read_particle_list(const fs::path& path, const fs::path& model_file,
                                const output::ModelInfo& model, const std::string& tomogram) {
  return path.extension() == ".star" ? read_relion(path, model_file, model, tomogram)
                                     : read_points(path, model_file, model, tomogram);
}

}  // namespace tomofield::exchange
