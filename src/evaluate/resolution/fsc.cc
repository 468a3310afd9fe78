#include "evaluate/resolution/fsc.h"

#include <fmt/format.h>
#include <kiss_fft.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numbers>

#include "base/check.h"
#include "base/log.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "base/utf8.h"
#include "evaluate/volume_pair.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

constexpr std::int64_t kTile = 16;  // lines copied together, 128 bytes of each row

// Transforms all lines of n values along one axis. Neighbours on a line are `stride` apart. The
// lines lie in bundles: `stride` lines beside each other, one bundle behind the other.
void transform_axis(std::int64_t n, std::int64_t stride, std::vector<std::complex<float>>& values) {
  const std::unique_ptr<void, decltype(&std::free)> plan(
      kiss_fft_alloc(static_cast<int>(n), 0, nullptr, nullptr), &std::free);
  TOMOFIELD_CHECK(plan != nullptr, "plan of the transform");
  const std::int64_t tiles = (stride + kTile - 1) / kTile;
  const std::int64_t bundles = std::ssize(values) / (n * stride);
  base::parallel_for("transform", bundles * tiles, [&](std::int64_t task) {
    const std::int64_t first_line = task % tiles * kTile;
    const std::int64_t lines = std::min(kTile, stride - first_line);
    std::complex<float>* first = values.data() + task / tiles * n * stride + first_line;
    std::vector<kiss_fft_cpx> in(static_cast<std::size_t>(lines * n)), out(in.size());
    for (std::int64_t i = 0; i < n; ++i)
      for (std::int64_t l = 0; l < lines; ++l)
        in[static_cast<std::size_t>(l * n + i)] = {first[i * stride + l].real(),
                                                   first[i * stride + l].imag()};
    for (std::int64_t l = 0; l < lines; ++l)
      kiss_fft(static_cast<kiss_fft_cfg>(plan.get()), in.data() + l * n, out.data() + l * n);
    for (std::int64_t i = 0; i < n; ++i)
      for (std::int64_t l = 0; l < lines; ++l)
        first[i * stride + l] = {out[static_cast<std::size_t>(l * n + i)].r,
                                 out[static_cast<std::size_t>(l * n + i)].i};
  });
}

// The sums [shell] over frequencies that the tilts cover and over those that they do not.
struct WedgeSums {
  std::vector<ShellSums> measured, missing;
};

std::int64_t longest_axis(const base::Shape3& shape) {
  return std::max({shape.nx, shape.ny, shape.nz});
}

// Returns the sum of body(z) over all sections, added in their order.
template <typename Body>
auto sum_sections(std::int64_t nz, const Body& body) {
  std::vector<decltype(body(std::int64_t{}))> parts(static_cast<std::size_t>(nz));
  base::parallel_for("sum sections", nz,
                     [&](std::int64_t z) { parts[static_cast<std::size_t>(z)] = body(z); });
  double sum = 0.0;
  for (const double part : parts) sum += part;
  return sum;
}

void check_weights(const base::Volume& weights) {
  const auto [low, high] = std::minmax_element(weights.data.begin(), weights.data.end());
  const bool is_finite =
      std::ranges::all_of(weights.data, [](float w) { return std::isfinite(w); });
  if (is_finite && *low >= 0.0f && *high <= 1.0f && *high > 0.0f) return;
  throw Error(
      fmt::format("the mask's voxels run from {} to {}: they must lie from 0 to 1 and not all be 0",
                  *low, *high));
}

// The input of the transform: values[i] = scale · weight[i] (volume[i] − mean). Its mean square is
// 1, so that both volumes fit one complex transform in single precision. A constant volume has
// scale 0.
struct Normalised {
  const base::Volume& volume;
  const base::Volume& weights;
  double mean = 0.0, scale = 0.0;

  Normalised(const base::Volume& v, const base::Volume& w) : volume(v), weights(w) {
    const std::int64_t section = v.shape.nx * v.shape.ny;
    const auto sum = [&](const auto& term) {
      return sum_sections(v.shape.nz, [&](std::int64_t z) {
        double total = 0.0;
        for (std::int64_t i = z * section; i < (z + 1) * section; ++i)
          total += term(static_cast<std::size_t>(i));
        return total;
      });
    };
    const auto weight = [&](std::size_t i) { return static_cast<double>(w.data[i]); };
    const auto value = [&](std::size_t i) { return static_cast<double>(v.data[i]); };
    mean = sum([&](std::size_t i) { return weight(i) * value(i); }) / sum(weight);
    const double squares = sum([&](std::size_t i) {
      const double centred = weight(i) * (value(i) - mean);
      return centred * centred;
    });
    if (!std::isfinite(squares))
      throw Error("a volume has NaN or infinite voxels: no shell correlation means anything");
    // Rounding leaves about 10⁻³² of the square of a constant volume.
    if (!(squares > 1e-20 * mean * mean)) return;
    scale = std::sqrt(static_cast<double>(v.data.size()) / squares);
  }

  bool is_constant() const { return scale == 0.0; }

  float operator()(std::size_t i) const {
    return static_cast<float>(scale * static_cast<double>(weights.data[i]) *
                              (static_cast<double>(volume.data[i]) - mean));
  }
};

// Returns the transform of first + i second: one transform serves both volumes.
std::vector<std::complex<float>> joint_transform(const Normalised& first,
                                                 const Normalised& second) {
  const base::Shape3& shape = first.volume.shape;
  std::vector<std::complex<float>> values(shape.voxels());
  base::parallel_for("join volumes", shape.nz, [&](std::int64_t z) {
    const std::size_t section = static_cast<std::size_t>(shape.nx * shape.ny);
    const std::size_t begin = static_cast<std::size_t>(z) * section;
    for (std::size_t i = begin; i < begin + section; ++i) values[i] = {first(i), second(i)};
  });
  transform_volume(shape, values);
  return values;
}

// Computes the sums of one section kz of a joint transform F. The volumes are real, so their own
// transforms are A(k) = (F(k) + conj F(−k)) / 2 and B(k) = (F(k) − conj F(−k)) / 2i.
WedgeSums section_sums(const base::Shape3& shape, const std::vector<std::complex<float>>& joint,
                       std::int64_t kz, const TiltRange& tilts) {
  const std::int64_t longest = longest_axis(shape);
  const std::size_t shells = static_cast<std::size_t>(longest / 2);
  WedgeSums sums{std::vector<ShellSums>(shells), std::vector<ShellSums>(shells)};
  const auto row = [&](std::int64_t y, std::int64_t z) {
    return joint.data() + (z * shape.ny + y) * shape.nx;
  };
  const auto cycles = [](std::int64_t k, std::int64_t n) {
    return static_cast<double>(signed_frequency(k, n)) / static_cast<double>(n);
  };
  const double z = cycles(kz, shape.nz);
  for (std::int64_t ky = 0; ky < shape.ny; ++ky) {
    const double y = cycles(ky, shape.ny);
    const std::complex<float>* there = row(ky, kz);
    const std::complex<float>* opposite =
        row((shape.ny - ky) % shape.ny, (shape.nz - kz) % shape.nz);
    for (std::int64_t kx = 0; kx < shape.nx; ++kx) {
      const double x = cycles(kx, shape.nx);
      const double radius = std::sqrt(x * x + y * y + z * z);
      const auto shell = std::lround(radius * static_cast<double>(longest));
      if (shell < 1 || shell > static_cast<long>(shells)) continue;
      const std::complex<double> f(there[kx]), g(std::conj(opposite[(shape.nx - kx) % shape.nx]));
      const std::complex<double> a = 0.5 * (f + g), b = std::complex(0.0, -0.5) * (f - g);
      auto& set = tilts.covers(x, y, z) ? sums.measured : sums.missing;
      set[static_cast<std::size_t>(shell - 1)] +=
          {a.real() * b.real() + a.imag() * b.imag(), std::norm(a), std::norm(b), 1};
    }
  }
  return sums;
}

WedgeSums shell_sums(const base::Shape3& shape, const std::vector<std::complex<float>>& joint,
                     const TiltRange& tilts) {
  std::vector<WedgeSums> sections(static_cast<std::size_t>(shape.nz));
  base::parallel_for("correlate sections", shape.nz, [&](std::int64_t kz) {
    sections[static_cast<std::size_t>(kz)] = section_sums(shape, joint, kz, tilts);
  });
  WedgeSums total = sections.front();
  for (std::size_t section = 1; section < sections.size(); ++section) {
    for (std::size_t s = 0; s < total.measured.size(); ++s) {
      total.measured[s] += sections[section].measured[s];
      total.missing[s] += sections[section].missing[s];
    }
  }
  return total;
}

FscCurve curve_of(const std::vector<ShellSums>& shells) {
  FscCurve curve;
  for (const ShellSums& sum : shells) {
    const double power = std::sqrt(sum.first * sum.second);
    curve.correlation.push_back(power > 0.0 ? sum.product / power
                                            : std::numeric_limits<double>::quiet_NaN());
    curve.voxels.push_back(sum.voxels);
  }
  return curve;
}

// Counts both volumes, the weights and the complex transform, in single precision.
constexpr std::size_t kBytesOfVoxel = 20;

void check_memory(const FscFiles& files) {
  const io::MrcReader file(files.second);
  const base::Box box = files.box.value_or(whole_box(file));
  if (!lies_within(box, whole_box(file))) return;  // read_pair() reports this error
  base::require_memory(kBytesOfVoxel * box.shape().voxels(), "the shell correlation",
                       "restrict it with --box, or bin both volumes");
}

base::Volume read_mask(const std::filesystem::path& path, const std::filesystem::path& second,
                       const base::Box& box) {
  const io::MrcReader mask(path), volume(second);
  if (whole_box(mask) != whole_box(volume)) {
    const auto size = [](const io::MrcReader& f) {
      return fmt::format("{} × {} × {}", f.header().nx, f.header().ny, f.header().nz);
    };
    throw Error(fmt::format("the mask '{}' has {} voxels and '{}' {}: give a mask of that size",
                            path.string(), size(mask), second.string(), size(volume)));
  }
  constexpr double kSamePlace_A = 0.1;
  const auto of_mask = place_A(mask), of_volume = place_A(volume);
  if (of_mask && of_volume && !std::ranges::equal(*of_mask, *of_volume, [](double a, double b) {
        return std::fabs(a - b) < kSamePlace_A;
      }))
    throw Error(
        fmt::format("the mask '{}' lies elsewhere than '{}' (ORIGIN): give one of its place",
                    path.string(), second.string()));
  base::Volume weights = read_box(mask, box);
  common_voxel_size_A(fmt::format("the mask '{}'", path.string()), weights.voxel_size_A,
                      fmt::format("'{}'", second.string()),
                      io::cubic_voxel_size_A(volume.header(), second));
  require_numbers(weights, path);
  return weights;
}

}  // namespace

void transform_volume(const base::Shape3& shape, std::vector<std::complex<float>>& values) {
  TOMOFIELD_CHECK(values.size() == shape.voxels(), "as many values as voxels");
  transform_axis(shape.nx, 1, values);
  transform_axis(shape.ny, shape.nx, values);
  transform_axis(shape.nz, shape.nx * shape.ny, values);
}

bool TiltRange::covers(double kx, double kz) const {
  if (kx == 0.0 && kz == 0.0) return true;
  const double angle = kx == 0.0 ? 90.0 : std::atan(kz / kx) * 180.0 / std::numbers::pi;
  return low_deg <= angle && angle <= high_deg;
}

base::Volume edge_window(const base::Shape3& shape) {
  const auto axis = [](std::int64_t n) {
    std::vector<double> window;
    const double edge = static_cast<double>(n) / 8.0;
    for (std::int64_t i = 0; i < n; ++i) {
      const double from_face = static_cast<double>(std::min(i, n - 1 - i)) + 0.5;
      const double s = std::sin(0.5 * std::numbers::pi * std::min(1.0, from_face / edge));
      window.push_back(s * s);
    }
    return window;
  };
  const auto x = axis(shape.nx), y = axis(shape.ny), z = axis(shape.nz);
  base::Volume weights(shape);
  std::size_t i = 0;
  for (const double wz : z)
    for (const double wy : y)
      for (const double wx : x) weights.data[i++] = static_cast<float>(wx * wy * wz);
  return weights;
}

void FscSums::add(const base::Volume& first, const base::Volume& second,
                  const base::Volume& weights, const std::optional<TiltRange>& tilts) {
  const base::Shape3& shape = first.shape;
  TOMOFIELD_CHECK(second.shape == shape && weights.shape == shape, "all of one shape");
  const std::int64_t longest = longest_axis(shape);
  if (longest < 4) throw Error("shell correlation needs an axis of 4 voxels or more");
  check_weights(weights);
  const Normalised a(first, weights), b(second, weights);
  if (a.is_constant() || b.is_constant()) return;
  const TiltRange all_tilts{-90.0, 90.0};
  const WedgeSums sums = shell_sums(shape, joint_transform(a, b), tilts.value_or(all_tilts));
  if (measured_.empty()) {
    unit_of_first_ = a.scale;
    unit_of_second_ = b.scale;
    length_A_ = static_cast<double>(longest) * second.voxel_size_A;
    has_tilts_ = tilts.has_value();
    measured_.resize(sums.measured.size());
    missing_.resize(sums.missing.size());
  }
  TOMOFIELD_CHECK(sums.measured.size() == measured_.size(), "all pairs of one shape");
  // Each pair has scales of its own, which are undone here.
  const double ratio_a = unit_of_first_ / a.scale, ratio_b = unit_of_second_ / b.scale;
  const auto in_common_units = [&](const ShellSums& s) {
    return ShellSums{s.product * ratio_a * ratio_b, s.first * ratio_a * ratio_a,
                     s.second * ratio_b * ratio_b, s.voxels};
  };
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    measured_[s] += in_common_units(sums.measured[s]);
    missing_[s] += in_common_units(sums.missing[s]);
  }
}

Fsc FscSums::correlation() const {
  if (measured_.empty())
    throw Error("a volume is constant under the mask: it correlates with nothing");
  Fsc fsc;
  if (has_tilts_) {
    fsc.measured = curve_of(measured_);
    fsc.missing = curve_of(missing_);
  }
  std::vector<ShellSums> all = measured_;
  for (std::size_t s = 0; s < all.size(); ++s) {
    all[s] += missing_[s];
    fsc.frequency_per_A.push_back(static_cast<double>(s + 1) / length_A_);
  }
  fsc.all = curve_of(all);
  return fsc;
}

Fsc fourier_shell_correlation(const base::Volume& first, const base::Volume& second,
                              const base::Volume& weights, const std::optional<TiltRange>& tilts) {
  FscSums sums;
  sums.add(first, second, weights, tilts);
  return sums.correlation();
}

std::optional<double> crossing_A(std::span<const double> frequency_per_A, const FscCurve& curve,
                                 double threshold) {
  std::optional<std::size_t> above;
  for (std::size_t s = 0; s < curve.correlation.size(); ++s) {
    const double value = curve.correlation[s];
    if (std::isnan(value)) continue;
    if (value >= threshold) {
      above = s;
      continue;
    }
    if (!above) return std::nullopt;
    const double before = curve.correlation[*above];
    const double f0 = frequency_per_A[*above], f1 = frequency_per_A[s];
    return 1.0 / (f0 + (f1 - f0) * (before - threshold) / (before - value));
  }
  return std::nullopt;
}

bool starts_below(const FscCurve& curve, double threshold) {
  const auto first =
      std::ranges::find_if(curve.correlation, [](double value) { return !std::isnan(value); });
  return first == curve.correlation.end() || *first < threshold;
}

std::optional<double> correlation_at(std::span<const double> frequency_per_A, const FscCurve& curve,
                                     double resolution_A) {
  const double frequency = 1.0 / resolution_A;
  std::optional<std::size_t> below;
  for (std::size_t s = 0; s < curve.correlation.size(); ++s) {
    if (std::isnan(curve.correlation[s])) continue;
    if (frequency_per_A[s] == frequency) return curve.correlation[s];
    if (frequency_per_A[s] < frequency) {
      below = s;
      continue;
    }
    if (!below) return std::nullopt;
    const double part =
        (frequency - frequency_per_A[*below]) / (frequency_per_A[s] - frequency_per_A[*below]);
    return std::lerp(curve.correlation[*below], curve.correlation[s], part);
  }
  return std::nullopt;
}

Fsc correlate_files(const FscFiles& files) {
  check_memory(files);
  VolumePair pair = read_pair(files.first, files.second, files.box);
  if (!io::is_known_size(pair.second.voxel_size_A)) {
    base::log_warning(fmt::format("'{}' has no voxel size: resolutions are in voxels, not in Å",
                                  files.second.string()));
    pair.second.voxel_size_A = 1.0;
  }
  const base::Volume weights =
      files.mask ? read_mask(*files.mask, files.second, pair.box) : edge_window(pair.second.shape);
  return fourier_shell_correlation(pair.first, pair.second, weights, files.tilts);
}

std::string fsc_csv(const Fsc& fsc) {
  const bool has_wedge = fsc.measured.has_value();
  std::string text = "frequency_per_A,resolution_A,fsc,voxels";
  text += has_wedge ? ",fsc_measured,voxels_measured,fsc_missing,voxels_missing\n" : "\n";
  for (std::size_t s = 0; s < fsc.frequency_per_A.size(); ++s) {
    const auto columns = [s](const FscCurve& curve) {
      const double value = curve.correlation[s];
      return fmt::format(",{},{}", std::isnan(value) ? "" : fmt::format("{:.6f}", value),
                         curve.voxels[s]);
    };
    text += fmt::format("{:.8g},{:.6g}", fsc.frequency_per_A[s], 1.0 / fsc.frequency_per_A[s]);
    text += columns(fsc.all);
    if (has_wedge) text += columns(*fsc.measured) + columns(*fsc.missing);
    text += "\n";
  }
  return text;
}

}  // namespace tomofield::evaluate
