#include "simulate/cryo/specimen.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "field/sampling/sample_box.h"
#include "simulate/cryo/bilayer.h"
#include "simulate/cryo/occupancy.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

constexpr std::uint64_t kShapeStream = 20;  // and one for each kind of particle
constexpr std::uint64_t kMembraneStream = 40;
constexpr std::uint64_t kReceptorStream = 41;
constexpr std::uint64_t kFilamentStream = 42;
constexpr std::uint64_t kParticleStream = 43;
// The content goes on this far beyond the field of view in Y, so that shifted views see it.
constexpr double kBeyondField_A = 240.0;
constexpr double kReferenceVolume_A3 = 2560.0 * 2560.0 * 1120.0;
constexpr double kLipidSpacing_A = 11.0;
constexpr double kGap_A = 20.0;  // that content keeps from other content
constexpr int kTries = 40;

struct Abundance {
  ProteinKind kind;
  double count = 0.0;  // in kReferenceVolume_A3
};

const std::array<Abundance, 4>& soluble_proteins() {
  static const std::array<Abundance, 4> kinds{{{{"ribosome", 3200.0, 1, false, 50.0}, 40.0},
                                               {{"proteasome", 720.0, 7, true, 25.7}, 30.0},
                                               {{"carboxylase", 550.0, 4, true, 23.0}, 60.0},
                                               {{"enzyme", 150.0, 1, false, 25.0}, 400.0}}};
  return kinds;
}

const ProteinKind kReceptor{"receptor", 250.0, 1, false, 25.0};
const ProteinKind kActin{"actin", 42.0, 1, false, 42.0};

Vector3 turned(const field::Rotation& rotation, const Vector3& v) {
  Vector3 result{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      result[row] += rotation[row][column] * v[column];
  return result;
}

Vector3 random_euler_deg(base::Random& random) {
  const double tilt_deg = std::acos(random.uniform(-1.0, 1.0)) * 180.0 / std::numbers::pi;
  return {random.uniform(-180.0, 180.0), tilt_deg, random.uniform(-180.0, 180.0)};
}

// Returns angles that turn the reference's z axis into a direction.
Vector3 euler_of_axis_deg(const Vector3& axis, base::Random& random) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  return {random.uniform(-180.0, 180.0), std::acos(std::clamp(axis[2], -1.0, 1.0)) * kDegrees,
          std::atan2(axis[1], -axis[0]) * kDegrees};
}

std::vector<Gaussian> placed(std::span<const Gaussian> reference, const Vector3& center_A,
                             const Vector3& euler_deg) {
  const field::Rotation rotation =
      field::rotation_from_euler(euler_deg[0], euler_deg[1], euler_deg[2]);
  std::vector<Gaussian> gaussians(reference.begin(), reference.end());
  for (Gaussian& g : gaussians) g.center_A = moved(center_A, 1.0, turned(rotation, g.center_A));
  return gaussians;
}

// Fills the slab, in Å about its centre.
class Builder {
 public:
  Builder(const CellOptions& options, double voxel_size_A)
      : seed_(options.seed),
        voxel_size_A_(voxel_size_A),
        specimen_{
            .phantom = make_slab(options), .membrane_points_px = {}, .kinds = {}, .particles = {}},
        half_A_(half_lengths_A()),
        share_(8.0 * half_A_[0] * half_A_[1] * half_A_[2] / kReferenceVolume_A3),
        taken_(half_A_) {
    specimen_.phantom.slab_density = 0.0;
  }

  CryoSpecimen build(const CellOptions& options, std::span<const ParticleFile> files) {
    add_gold(options);
    add_membranes();
    add_filaments();
    if (files.empty()) {
      for (const Abundance& protein : soluble_proteins())
        add_particles(add_kind(protein.kind), number_of(protein.count));
    }
    for (const ParticleFile& file : files)
      add_particles(add_kind(file), number_in_field(file.count));
    return std::move(specimen_);
  }

 private:
  Vector3 half_lengths_A() const {
    const Phantom& phantom = specimen_.phantom;
    return {voxel_size_A_ * phantom.half_width_px,
            voxel_size_A_ * static_cast<double>(phantom.shape.ny) / 2.0 + kBeyondField_A,
            voxel_size_A_ * static_cast<double>(phantom.shape.nz) / 2.0};
  }

  int number_of(double count_in_reference) const {
    return static_cast<int>(std::lround(count_in_reference * share_));
  }

  // Returns the number in the box of what has a mean number in the field of view.
  int number_in_field(double count) const {
    const base::Shape3& shape = specimen_.phantom.shape;
    const double field = voxel_size_A_ * voxel_size_A_ * static_cast<double>(shape.nx * shape.ny);
    return static_cast<int>(std::lround(count * 4.0 * half_A_[0] * half_A_[1] / field));
  }

  Vector3 random_point(const Vector3& half, base::Random& random) const {
    Vector3 p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = random.uniform(-half[i], half[i]);
    return p;
  }

  bool are_free(std::span<const Gaussian> gaussians) const {
    return std::ranges::all_of(gaussians,
                               [&](const Gaussian& g) { return taken_.is_free(g.center_A); });
  }

  Vector3 in_voxels(const Vector3& position_A) const {
    return moved({}, 1.0 / voxel_size_A_, position_A);
  }

  void add(std::span<const Gaussian> gaussians) {
    for (const Gaussian& g : gaussians) {
      taken_.take(g.center_A, kGap_A);
      specimen_.phantom.blobs.push_back(blob_of(g, voxel_size_A_));
    }
  }

  // Adds a vesicle if it touches nothing. Only the part within the box is made.
  bool add_vesicle(const VesicleShape& shape, std::vector<SurfacePoint>& surface) {
    std::vector<SurfacePoint> inside;
    for (const SurfacePoint& p : surface_points(shape, kLipidSpacing_A)) {
      bool is_inside = true;
      for (std::size_t a = 0; a < 3; ++a)
        is_inside = is_inside && std::abs(p.position_A[a]) < half_A_[a] + kGap_A;
      if (is_inside) inside.push_back(p);
    }
    for (const SurfacePoint& p : inside)
      for (const double height : {-3.0 * kGap_A, 0.0, 3.0 * kGap_A})
        if (!taken_.is_free(moved(p.position_A, height, p.normal))) return false;
    std::vector<Gaussian> lipids;
    for (const SurfacePoint& p : inside) {
      add_bilayer(p, lipids);
      specimen_.membrane_points_px.push_back(in_voxels(p.position_A));
    }
    add(lipids);
    surface.insert(surface.end(), inside.begin(), inside.end());
    return true;
  }

  void add_vesicles(int count, double low_A, double high_A, bool is_cut, base::Random& random,
                    std::vector<SurfacePoint>& surface) {
    for (int i = 0; i < count; ++i) {
      const double radius = random.uniform(low_A, high_A);
      for (int attempt = 0; attempt < kTries; ++attempt) {
        VesicleShape shape{.axes = random_axes(random),
                           .semi_axes_A = random_semi_axes(0.8 * radius, radius, random)};
        Vector3 half = half_A_;
        half[2] = is_cut ? half_A_[2] : half_A_[2] - radius - 2.0 * kGap_A;
        if (half[2] < 0.0) break;
        shape.center_A = random_point(half, random);
        if (add_vesicle(shape, surface)) break;
      }
    }
  }

  void add_gold(const CellOptions& options) {
    add_beads(options, specimen_.phantom);
    for (const Ellipsoid& bead : specimen_.phantom.bodies)
      taken_.take(moved({}, voxel_size_A_, bead.center), voxel_size_A_ * bead.radius + kGap_A);
  }

  void add_membranes() {
    base::Random random(seed_, kMembraneStream);
    std::vector<SurfacePoint> surface;
    add_vesicles(number_of(1.0), 700.0, 1200.0, true, random, surface);
    add_vesicles(number_of(7.0), 200.0, 450.0, false, random, surface);
    add_receptors(surface);
  }

  void add_receptors(std::span<const SurfacePoint> surface) {
    base::Random random(seed_, kReceptorStream);
    constexpr double kArea_A2 = 250.0 * 250.0;
    const std::size_t kind = add_kind(kReceptor);
    const auto& reference = specimen_.kinds[kind].reference;
    const double height_A = kHalfBilayer_A + kGap_A + radius_A(reference);
    for (const SurfacePoint& p : surface) {
      if (random.uniform() > p.area_A2 / kArea_A2) continue;
      place(kind, moved(p.position_A, height_A, p.normal), euler_of_axis_deg(p.normal, random));
    }
  }

  void add_filaments() {
    // RELION's angles turn the frame and not the subunit, which turns by −166.6°.
    constexpr double kRise_A = 27.5, kTurn_deg = 166.6, kRadius_A = 18.0;
    base::Random random(seed_, kFilamentStream);
    const std::vector<Gaussian> subunit = make_protein(kActin, random);
    for (int i = 0; i < number_of(10.0); ++i) {
      Vector3 direction = random_direction(random);
      direction[2] *= 0.3;  // most lie along the film
      direction = normalized(direction);
      const Vector3 angles = euler_of_axis_deg(direction, random);
      const Vector3 start = random_point(half_A_, random);
      const int most = static_cast<int>(random.uniform(800.0, 3000.0) / kRise_A);
      std::vector<Gaussian> filament;
      for (int n = 0; n < most; ++n) {
        const double turn_deg = angles[0] + kTurn_deg * n;
        const field::Rotation rotation = field::rotation_from_euler(turn_deg, angles[1], angles[2]);
        const Vector3 center = moved(moved(start, kRise_A * n, direction), 1.0,
                                     turned(rotation, {kRadius_A, 0.0, 0.0}));
        const auto next = placed(subunit, center, {turn_deg, angles[1], angles[2]});
        if (!are_free(next) || std::abs(center[2]) > half_A_[2] - 2.0 * kGap_A) break;
        filament.insert(filament.end(), next.begin(), next.end());
      }
      add(filament);
    }
  }

  std::size_t add_kind(const ProteinKind& kind) {
    const std::size_t index = specimen_.kinds.size();
    specimen_.kinds.push_back(
        {kind.name, make_protein(kind, base::Random(seed_, kShapeStream + index))});
    return index;
  }

  std::size_t add_kind(const ParticleFile& file) {
    const std::string name = file.path.stem().string();
    if (std::ranges::find(specimen_.kinds, name, &ParticleKind::name) != specimen_.kinds.end())
      throw Error(fmt::format(
          "two kinds of particles have the name '{}': rename the file '{}', whose name is that of "
          "its particles",
          name, file.path.string()));
    std::vector<Gaussian> density = read_density(file.path);
    require_size(density, file.path);
    specimen_.kinds.push_back({name, std::move(density)});
    return specimen_.kinds.size() - 1;
  }

  // Throws Error for a particle that is larger than the field of view, or of less than a voxel.
  void require_size(std::span<const Gaussian> density, const std::filesystem::path& file) const {
    double sigma_A = 0.0;
    for (const Gaussian& gaussian : density) sigma_A = std::max(sigma_A, gaussian.sigma_A);
    const double width_A = 2.0 * (radius_A(density) + sigma_A);
    const base::Shape3& shape = specimen_.phantom.shape;
    const double field_A = voxel_size_A_ * static_cast<double>(std::min(shape.nx, shape.ny));
    const double least_A = voxel_size_A_ / 4.0;
    if (width_A >= least_A && width_A <= field_A) return;
    throw Error(fmt::format(
        "'{}' is a particle of {:.4g} Å, and one from {:g} Å, a quarter of a voxel, to {:g} Å, the "
        "field of view, can be seen: correct the voxel size of its header",
        file.string(), width_A, least_A, field_A));
  }

  // Adds a particle if it touches nothing and lies within the slab.
  bool place(std::size_t kind, const Vector3& center_A, const Vector3& euler_deg) {
    const auto gaussians = placed(specimen_.kinds[kind].reference, center_A, euler_deg);
    for (const Gaussian& g : gaussians)
      if (std::abs(g.center_A[2]) > half_A_[2] - kGap_A) return false;
    if (!are_free(gaussians)) return false;
    add(gaussians);
    specimen_.particles.push_back({kind, in_voxels(center_A), euler_deg});
    return true;
  }

  void add_particles(std::size_t kind, int count) {
    base::Random random(seed_, kParticleStream + kind - 1);  // kind 0 is that of receptors
    for (int n = 0; n < count; ++n)
      for (int attempt = 0; attempt < kTries; ++attempt)
        if (place(kind, random_point(half_A_, random), random_euler_deg(random))) break;
  }

  std::uint64_t seed_;
  double voxel_size_A_;
  CryoSpecimen specimen_;
  Vector3 half_A_;
  double share_;  // volume of the slab / kReferenceVolume_A3
  Occupancy taken_;
};

}  // namespace

CryoSpecimen make_cryo_specimen(const CellOptions& options, double voxel_size_A,
                                std::span<const ParticleFile> files) {
  return Builder(options, voxel_size_A).build(options, files);
}

}  // namespace tomofield::simulate
