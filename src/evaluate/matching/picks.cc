#include "evaluate/matching/picks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "base/utf8.h"
#include "evaluate/box.h"
#include "evaluate/matching/detection.h"
#include "evaluate/matching/template_match.h"
#include "evaluate/volume_pair.h"
#include "io/images/mrc_format.h"
#include "io/tables/star_file.h"
#include "io/tables/unknown_entries.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

using Position = std::array<double, 3>;

constexpr double kSearchVoxel_A = 20.0;
constexpr int kRotations = 96;
constexpr const char* kKind = "tomofieldParticleKind";

double squared_distance(const Position& a, const Position& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

double reference_radius_px(const base::Volume& density) {
  const float limit = 0.1f * *std::ranges::max_element(density.data);
  const base::Shape3& n = density.shape;
  const double centre = static_cast<double>(n.nx) / 2.0;
  double squared = 0.0;
  for (std::int64_t z = 0; z < n.nz; ++z)
    for (std::int64_t y = 0; y < n.ny; ++y)
      for (std::int64_t x = 0; x < n.nx; ++x)
        if (density.at(x, y, z) > limit)
          squared = std::max(
              squared, squared_distance({static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                                         static_cast<double>(z) + 0.5},
                                        {centre, centre, centre}));
  return std::sqrt(squared);
}

// Returns the means over bin³ voxels. Voxels that are left over at the ends are dropped.
base::Volume binned(const base::Volume& volume, std::int64_t bin) {
  const base::Shape3& n = volume.shape;
  base::Volume result({n.nx / bin, n.ny / bin, n.nz / bin},
                      static_cast<double>(bin) * volume.voxel_size_A);
  const float scale = 1.0f / static_cast<float>(bin * bin * bin);
  for (std::int64_t z = 0; z < result.shape.nz * bin; ++z)
    for (std::int64_t y = 0; y < result.shape.ny * bin; ++y)
      for (std::int64_t x = 0; x < result.shape.nx * bin; ++x)
        result.at(x / bin, y / bin, z / bin) += scale * volume.at(x, y, z);
  return result;
}

// Returns a cube with zeros around it, so that its side is a multiple of 2 bin.
base::Volume padded(const base::Volume& cube, std::int64_t bin) {
  const std::int64_t n = cube.shape.nx;
  const std::int64_t side = (n + 2 * bin - 1) / (2 * bin) * (2 * bin);
  const std::int64_t before = (side - n) / 2;
  base::Volume result({side, side, side}, cube.voxel_size_A);
  for (std::int64_t z = 0; z < n; ++z)
    for (std::int64_t y = 0; y < n; ++y)
      for (std::int64_t x = 0; x < n; ++x)
        result.at(x + before, y + before, z + before) = cube.at(x, y, z);
  return result;
}

// Returns which picks are true, the highest first, where each particle is found once.
std::vector<Detection> judge(const std::vector<Pick>& picks, const std::vector<Position>& particles,
                             double radius) {
  std::vector<bool> is_found(particles.size());
  std::vector<Detection> detections;
  for (const Pick& pick : picks) {
    std::size_t nearest = particles.size();
    double least = radius * radius;
    for (std::size_t i = 0; i < particles.size(); ++i) {
      const double squared = squared_distance(pick.position_px, particles[i]);
      if (!is_found[i] && squared < least) {
        least = squared;
        nearest = i;
      }
    }
    const bool is_true = nearest < particles.size();
    if (is_true) is_found[nearest] = true;
    detections.push_back({pick.correlation, is_true});
  }
  return detections;
}

// Throws Error for what lists of other programs have beside the positions that simulate writes.
void require_plain(const std::filesystem::path& list, const io::StarTable& table) {
  constexpr std::array<std::string_view, 10> kPlain{"rlnCoordinateX",
                                                    "rlnCoordinateY",
                                                    "rlnCoordinateZ",
                                                    "rlnAngleRot",
                                                    "rlnAngleTilt",
                                                    "rlnAnglePsi",
                                                    kKind,
                                                    "rlnTomoName",
                                                    "rlnClassNumber",
                                                    "rlnGroupNumber"};
  const auto others = io::unknown_columns(table, kPlain);
  if (!others.empty())
    throw Error(fmt::format(
        "'{}' has the column {}, and scores take the positions and kinds that simulate writes "
        "alone: apply it, and leave it out",
        list.string(), others.front()));
  for (std::size_t row = 1; row < table.num_rows(); ++row)
    if (table.find(row, "rlnTomoName") != table.find(0, "rlnTomoName"))
      throw Error(
          fmt::format("'{}' has particles of several tomograms (_rlnTomoName), and scores "
                      "are of one volume: leave those of one",
                      list.string()));
}

// Returns the table of the particles in a list.
io::StarTable read_table(const std::filesystem::path& list) {
  const std::vector<io::StarTable> tables = io::read_star_file(list);
  for (const io::StarTable& table : tables) require_plain(list, table);
  if (const io::StarTable* table = io::find_only_table(list, tables, kKind)) return *table;
  throw Error(fmt::format("'{}' has no column _{}: give the particles.star of simulate",
                          list.string(), kKind));
}

}  // namespace

std::filesystem::path density_of(const std::filesystem::path& list, const std::string& kind) {
  return list.parent_path() / fmt::format("particle_{}.mrc", kind);
}

std::vector<std::string> particle_kinds(const std::filesystem::path& list) {
  std::vector<std::string> kinds;
  const io::StarTable table = read_table(list);
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    std::string kind = io::StarRow(list, table, row).text(kKind);
    if (std::ranges::find(kinds, kind) == kinds.end()) kinds.push_back(std::move(kind));
  }
  return kinds;
}

std::vector<ParticleReference> read_particles(const std::filesystem::path& list) {
  const io::StarTable table = read_table(list);
  std::vector<ParticleReference> references;
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    const io::StarRow values(list, table, row);
    const std::string kind = values.text(kKind);
    auto reference = std::ranges::find(references, kind, &ParticleReference::kind);
    if (reference == references.end()) {
      const auto file = density_of(list, kind);
      reference = references.insert(references.end(), {kind, read_volume(file), {}});
      require_numbers(reference->density, file);
      const base::Shape3& n = reference->density.shape;
      if (n.nx != n.ny || n.ny != n.nz || n.nx % 2 != 0)
        throw Error(
            fmt::format("'{}' must be a cube of an even number of voxels, but has {} × {} × {}",
                        file.string(), n.nx, n.ny, n.nz));
    }
    reference->positions_px.push_back({values.number("rlnCoordinateX"),
                                       values.number("rlnCoordinateY"),
                                       values.number("rlnCoordinateZ")});
  }
  return references;
}

PickScore pick_score(const base::Volume& volume, const ParticleReference& particle) {
  if (!io::is_known_size(volume.voxel_size_A))
    throw Error(
        "the volume has no voxel size, by which particles are looked for: set that of its "
        "header");
  if (voxel_sizes_differ(volume.voxel_size_A, particle.density.voxel_size_A, 0.01))
    throw Error(fmt::format(
        "the volume has voxels of {:g} Å and the density of the particle '{}' of {:g} Å: give a "
        "volume with the voxels of the simulated truth",
        volume.voxel_size_A, particle.kind, particle.density.voxel_size_A));
  const auto bin = std::max<std::int64_t>(1, std::llround(kSearchVoxel_A / volume.voxel_size_A));
  const double radius = reference_radius_px(particle.density) / static_cast<double>(bin);
  const base::Volume searched = binned(volume, bin);
  const std::array<std::int64_t, 3> size{searched.shape.nx, searched.shape.ny, searched.shape.nz};
  std::vector<Position> particles;
  for (Position p : particle.positions_px) {
    bool is_inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      p[a] /= static_cast<double>(bin);
      is_inside = is_inside && p[a] > radius && p[a] < static_cast<double>(size[a]) - radius;
    }
    if (is_inside) particles.push_back(p);
  }
  PickScore score{particle.kind, std::ssize(particles),
                  radius * static_cast<double>(bin) * volume.voxel_size_A, 0.0};
  if (particles.empty()) return score;
  const TemplateMatcher matcher(searched, radius);
  const base::Volume correlation =
      matcher.correlate(binned(padded(particle.density, bin), bin), even_rotations(kRotations));
  const auto picks = find_picks(correlation, radius, radius, 10 * particles.size());
  score.average_precision =
      score_detections(judge(picks, particles, radius), particles.size()).average_precision;
  return score;
}

}  // namespace tomofield::evaluate
