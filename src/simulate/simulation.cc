#include "simulate/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/plausible.h"
#include "base/random.h"
#include "microscope/view_transfer.h"

namespace tomofield::simulate {
namespace {

constexpr std::uint64_t kGainStream = 3;
constexpr double kMaxTilt_deg = 80.0;
constexpr std::int64_t kMaxSize_px = 32768;
constexpr std::int64_t kMaxViews = 10000;

std::int64_t count_views(const TiltRange& tilts) {
  return static_cast<std::int64_t>(
             std::floor((tilts.last_deg - tilts.first_deg) / tilts.step_deg + 1e-6)) +
         1;
}

double largest_tilt_deg(const TiltRange& tilts) {
  return std::max(std::abs(tilts.first_deg), std::abs(tilts.last_deg));
}

// Returns over how many pixels the smallest or the largest defocus spreads detail.
double largest_spread_px(const Imaging& imaging, double voxel_size_A) {
  constexpr double kAngstroms_in_um = 1e4;
  microscope::ViewTransfer transfer{.optics = imaging.optics, .defocus = {}, .slope = {}};
  transfer.pixel_size_A = voxel_size_A;
  transfer.defocus.u_A =
      kAngstroms_in_um * (imaging.defocus->high_um + imaging.astigmatism_um / 2.0);
  transfer.defocus.v_A =
      kAngstroms_in_um * (imaging.defocus->low_um - imaging.astigmatism_um / 2.0);
  return microscope::spread_px(transfer);
}

std::optional<std::string> fault_of(const TiltRange& tilts) {
  const bool is_finite = std::isfinite(tilts.first_deg) && std::isfinite(tilts.last_deg) &&
                         std::isfinite(tilts.step_deg);
  if (!is_finite || tilts.step_deg <= 0.0 || tilts.last_deg < tilts.first_deg)
    return fmt::format("the tilts {}:{}:{} are no range: give first:last:step in degrees",
                       tilts.first_deg, tilts.last_deg, tilts.step_deg);
  if (largest_tilt_deg(tilts) > kMaxTilt_deg)
    return fmt::format("tilts reach {}°: tomofield works up to ±{}°", largest_tilt_deg(tilts),
                       kMaxTilt_deg);
  if ((tilts.last_deg - tilts.first_deg) / tilts.step_deg > static_cast<double>(kMaxViews))
    return fmt::format("a tilt step of {}° makes more than {} views", tilts.step_deg, kMaxViews);
  return std::nullopt;
}

}  // namespace

TiltRange default_tilts(bool is_extended) {
  if (is_extended) return {.first_deg = -60.0, .last_deg = 60.0, .step_deg = 2.0};
  return {};
}

namespace {

void apply_yardstick_d(SimulationOptions& options) {
  constexpr double kThickness_A = 1120.0, kFieldOfBeads_A = 2560.0, kBeads = 8.0, kGold_V = 25.0;
  if (!base::is_plausible_pixel_size(options.voxel_size_A)) return;  // validate() says so
  CellOptions& cell = options.cell;
  cell.content = Content::kCryo;
  cell.is_extended = true;
  cell.thickness_px = std::llround(kThickness_A / options.voxel_size_A);
  const double field = static_cast<double>(cell.size_px) * options.voxel_size_A / kFieldOfBeads_A;
  cell.num_beads = std::llround(kBeads * field * field);
  cell.bead_density = kGold_V;
  options.reference_has_beads = false;
  options.tilts = {.first_deg = -60.0, .last_deg = 60.0, .step_deg = 3.0};
  options.imaging.dose_per_tilt = 3.0;
  options.imaging.defocus = {2.0, 4.0};
  options.imaging.defocus_scatter_um = 0.15;
  options.contrast = Contrast::kDark;
}

}  // namespace

void apply_yardstick(Yardstick yardstick, SimulationOptions& options) {
  if (yardstick == Yardstick::kD) return apply_yardstick_d(options);
  constexpr double kThicknessOfSize = 75.0 / 128.0;
  CellOptions& cell = options.cell;
  const auto size = static_cast<double>(cell.size_px);
  cell.is_extended = yardstick != Yardstick::kA;
  cell.thickness_px = std::llround(kThicknessOfSize * size);
  options.tilts = default_tilts(cell.is_extended);
  if (yardstick != Yardstick::kC) return;
  cell.content = Content::kTextured;
  cell.num_beads = std::llround(12.0 * size * size / (256.0 * 256.0));
  options.gain_spread = 0.03;
  options.reference_has_beads = false;
}

std::vector<std::string> SimulationOptions::validate() const {
  std::vector<std::string> faults;
  const auto require = [&](bool holds, const char* name, double value, const std::string& range) {
    if (!holds) faults.push_back(fmt::format("{} is {}, but must be {}", name, value, range));
  };
  const auto in_sizes = [](std::int64_t n) { return n >= 8 && n <= kMaxSize_px; };
  const auto is_spread = [](double v, double most) { return v >= 0.0 && v <= most; };
  const std::string sizes = fmt::format("8 to {} pixels", kMaxSize_px);
  require(in_sizes(cell.size_px), "the size", static_cast<double>(cell.size_px), sizes);
  require(in_sizes(cell.thickness_px), "the thickness", static_cast<double>(cell.thickness_px),
          sizes);
  require(base::is_plausible_pixel_size(voxel_size_A), "the voxel size", voxel_size_A,
          fmt::format("{} to {} Å", base::kPixelSizes_A.low(), base::kPixelSizes_A.high()));
  require(is_spread(noise, 1e6), "the noise", noise, "0 to 1e6");
  require(!dose || (*dose >= 1e-3 && *dose <= 1e9), "the dose", dose.value_or(0.0),
          "0.001 to 1e9 electrons per pixel and view");
  require(absorption_per_A > 0.0 && absorption_per_A <= 1.0, "the absorption", absorption_per_A,
          "above 0 and at most 1 per Å");
  require(is_spread(gain_spread, 2.0), "the gain's spread", gain_spread, "0 to 2");
  const auto size = static_cast<double>(cell.size_px);
  const Misalignment& m = misalignment;
  require(is_spread(m.shift_spread_px, size / 4.0), "the shifts' spread", m.shift_spread_px,
          "0 to a quarter of the size");
  require(is_spread(m.rotation_spread_deg, 20.0), "the rotations' spread", m.rotation_spread_deg,
          "0 to 20 degrees");
  require(is_spread(m.magnification_spread, 0.2), "the magnifications' spread",
          100.0 * m.magnification_spread, "0 to 20 percent");
  require(std::abs(m.axis_deg) <= 180.0, "the rotation of the tilt axis", m.axis_deg,
          "-180 to 180 degrees");
  require(is_spread(m.local_px, size / 20.0), "the local motion", m.local_px,
          "0 to a twentieth of the size");
  require(is_spread(m.tilt_spread_deg, 5.0), "the tilt angles' spread", m.tilt_spread_deg,
          "0 to 5 degrees");
  const Imaging& i = imaging;
  if (i.defocus) {
    const auto [low, high] = *i.defocus;
    require(is_spread(low, 50.0) && high >= low && high <= 50.0, "the defocus in µm", high,
            "a range within 0 to 50, the smaller number first");
    require(largest_spread_px(i, voxel_size_A) <= static_cast<double>(cell.size_px),
            "the number of pixels over which the defocus and --cs spread detail",
            largest_spread_px(i, voxel_size_A),
            fmt::format("at most {}, as views have: take a smaller defocus, larger voxels or views",
                        cell.size_px));
  }
  for (const ParticleFile& file : particle_files)
    require(std::isfinite(file.count) && file.count > 0.0 && file.count <= 1e5,
            "the number of particles in the field of view", file.count, "above 0 and at most 1e5");
  require(!is_physical() || i.dose_per_tilt > 0.0, "the dose per tilt", i.dose_per_tilt,
          "above 0 electrons per Å² for counts of electrons");
  require(is_spread(i.astigmatism_um, 5.0), "the astigmatism in µm", i.astigmatism_um, "0 to 5");
  require(i.optics.voltage_kV >= 20.0 && i.optics.voltage_kV <= 3000.0, "the voltage in kV",
          i.optics.voltage_kV, "20 to 3000");
  require(is_spread(i.optics.spherical_aberration_mm, 20.0), "the spherical aberration in mm",
          i.optics.spherical_aberration_mm, "0 to 20");
  require(is_spread(i.optics.amplitude_contrast, 1.0), "the amplitude contrast",
          i.optics.amplitude_contrast, "0 to 1");
  require(is_spread(i.dose_per_tilt, 1000.0), "the dose per tilt", i.dose_per_tilt,
          "0 to 1000 electrons per Å²");
  require(is_spread(noise_blur_px, 20.0), "the noise's blur", noise_blur_px, "0 to 20 pixels");
  require(cell.num_beads >= 0 && cell.num_beads <= 100000, "the number of gold beads",
          static_cast<double>(cell.num_beads), "0 to 100000");
  if (cell.num_beads > 0) {
    const auto room = static_cast<double>(std::min(cell.size_px, cell.thickness_px));
    require(cell.bead_diameter_px > 0.0 && cell.bead_diameter_px <= room,
            "the gold beads' diameter in voxels", cell.bead_diameter_px,
            fmt::format("above 0 and at most {}", room));
    require(std::abs(cell.bead_density) <= 1e6, "the gold beads' density", cell.bead_density,
            "-1e6 to 1e6");
  }
  if (const auto fault = fault_of(tilts)) faults.push_back(*fault);
  return faults;
}

std::vector<SimulatedView> plan_views(const SimulationOptions& options) {
  base::Random gains(options.cell.seed, kGainStream);
  std::vector<SimulatedView> views(static_cast<std::size_t>(count_views(options.tilts)));
  const std::uint64_t seed = options.cell.seed;
  const auto maps = draw_maps(options.misalignment, seed, views.size());
  std::vector<geometry::ViewWarp> warps;
  if (options.misalignment.local_px > 0.0)
    warps = draw_warps(options.misalignment.local_px, static_cast<double>(options.cell.size_px),
                       seed, views.size());
  const auto tilt_errors_deg =
      draw_tilt_errors(options.misalignment.tilt_spread_deg, seed, views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].tilt_error_deg = tilt_errors_deg[i];
    views[i].tilt_deg = options.tilts.first_deg + options.tilts.step_deg * static_cast<double>(i);
    views[i].gain = std::exp(options.gain_spread * gains.normal());
    views[i].raw_from_aligned = maps[i];
    if (!warps.empty()) views[i].warp = warps[i];
  }
  const auto defoci = draw_defoci(options.imaging, seed, views.size());
  std::vector<double> tilts_deg;
  for (const SimulatedView& view : views) tilts_deg.push_back(view.tilt_deg);
  const auto exposures = microscope::exposures_in_order(dose_symmetric_order(tilts_deg),
                                                        options.imaging.dose_per_tilt);
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].defocus = defoci[i];
    views[i].exposure = exposures[i];
  }
  return views;
}

Detector::Detector(const SimulationOptions& options)
    : counts_(options.dose.has_value()),
      absorption_per_px_(options.absorption_per_A * options.voxel_size_A) {
  if (counts_) {
    empty_beam_ = *options.dose;
  } else if (options.contrast == Contrast::kDark) {
    const double tilt_rad = largest_tilt_deg(options.tilts) * std::numbers::pi / 180.0;
    empty_beam_ = static_cast<double>(options.cell.thickness_px) / std::cos(tilt_rad);
    sign_ = -1.0;
  }
}

void Detector::expose(std::vector<float>& image, double gain) const {
  for (float& value : image) {
    const double integral = static_cast<double>(value);
    value =
        static_cast<float>(gain * (counts_ ? empty_beam_ * std::exp(-absorption_per_px_ * integral)
                                           : empty_beam_ + sign_ * integral));
  }
}

}  // namespace tomofield::simulate
