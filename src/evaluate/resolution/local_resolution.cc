#include "evaluate/resolution/local_resolution.h"

#include <kiss_fftnd.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <span>

#include "base/check.h"
#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "evaluate/box.h"
#include "evaluate/uncertainty.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"

namespace tomofield::evaluate {
namespace {

constexpr std::int64_t kSide = kResolutionWindow;
constexpr int kShells = static_cast<int>(kSide / 2);
constexpr std::int64_t kWindowVoxels = kSide * kSide * kSide;
constexpr std::int64_t kRowsOfWindows = 16;  // that are in memory together

// The windows along an axis of the file.
struct WindowAxis {
  std::int64_t length = 0;          // of a window, in voxels
  std::vector<std::int64_t> begin;  // of each window
  std::vector<double> weight;       // [voxel of a window]
};

WindowAxis windows_along(std::int64_t n) {
  WindowAxis axis{.length = std::min(n, kSide), .begin = {}, .weight = {}};
  const std::int64_t gaps = (n - axis.length + kResolutionStep - 1) / kResolutionStep;
  for (std::int64_t i = 0; i <= gaps; ++i)
    axis.begin.push_back(gaps == 0 ? 0 : i * (n - axis.length) / gaps);
  for (std::int64_t i = 0; i < axis.length; ++i) {
    const double s = std::sin(std::numbers::pi * (static_cast<double>(i) + 0.5) /
                              static_cast<double>(axis.length));
    axis.weight.push_back(s * s);
  }
  return axis;
}

// The shell of each frequency [z, y, x] of a window, from 1; 0: of none, or the tilts do not cover
// it. A frequency and its opposite count once.
std::vector<std::uint8_t> shells_of(const TiltRange& tilts) {
  std::vector<std::uint8_t> shells;
  const auto cycles = [](std::int64_t k) {
    return static_cast<double>(signed_frequency(k, kSide));
  };
  for (std::int64_t z = 0; z < kSide; ++z) {
    for (std::int64_t y = 0; y < kSide; ++y) {
      for (std::int64_t x = 0; x < kSide; ++x) {
        const double kx = cycles(x), ky = cycles(y), kz = cycles(z);
        const long shell = std::lround(std::sqrt(kx * kx + ky * ky + kz * kz));
        const bool counts = x <= kSide / 2 && shell <= kShells && tilts.covers(kx, ky, kz);
        shells.push_back(counts ? static_cast<std::uint8_t>(shell) : std::uint8_t{0});
      }
    }
  }
  return shells;
}

// Returns the frequency at which a curve [shell - 1] first falls below the threshold.
float frequency_of(const std::array<ShellSums, kShells + 2>& sums) {
  double before = 1.0;
  for (int shell = 1; shell <= kShells; ++shell) {
    ShellSums s;
    for (int i = std::max(shell - 1, 1); i <= std::min(shell + 1, kShells); ++i)
      s += sums[static_cast<std::size_t>(i)];
    const double power = std::sqrt(s.first * s.second);
    const double correlation = power > 0 ? s.product / power : 0.0;
    if (correlation < kLocalThreshold) {
      const double at = shell - 1 + (before - kLocalThreshold) / (before - correlation);
      return static_cast<float>(std::max(at, 1.0) / static_cast<double>(kSide));
    }
    before = correlation;
  }
  return 0.5f;
}

// Correlates windows. Each thread needs its own.
class WindowCorrelation {
 public:
  WindowCorrelation(const std::array<WindowAxis, 3>& axes, std::span<const std::uint8_t> shells)
      : axes_(axes),
        shells_(shells),
        plan_(kiss_fftnd_alloc(kSizes.data(), 3, 0, nullptr, nullptr), &std::free),
        values_(static_cast<std::size_t>(kWindowVoxels)),
        transformed_(values_.size()) {
    TOMOFIELD_CHECK(plan_ != nullptr, "plan of the transform");
  }

  // Returns the frequency of the window that begins at x, y, 0 of two slabs.
  float operator()(const base::Volume& first, const base::Volume& second, std::int64_t x,
                   std::int64_t y) {
    const double mean_a = mean_of(first, x, y), mean_b = mean_of(second, x, y);
    std::ranges::fill(values_, kiss_fft_cpx{0, 0});
    for_voxels([&](std::int64_t i, std::int64_t j, std::int64_t k, double weight) {
      const std::size_t from = first.index(x + i, y + j, k);
      values_[static_cast<std::size_t>((k * kSide + j) * kSide + i)] = {
          static_cast<float>(weight * (static_cast<double>(first.data[from]) - mean_a)),
          static_cast<float>(weight * (static_cast<double>(second.data[from]) - mean_b))};
    });
    kiss_fftnd(static_cast<kiss_fftnd_cfg>(plan_.get()), values_.data(), transformed_.data());
    return frequency_of(sums());
  }

 private:
  static constexpr std::array<int, 3> kSizes{kSide, kSide, kSide};

  template <typename Body>
  void for_voxels(const Body& body) const {
    for (std::int64_t k = 0; k < axes_[2].length; ++k)
      for (std::int64_t j = 0; j < axes_[1].length; ++j)
        for (std::int64_t i = 0; i < axes_[0].length; ++i)
          body(i, j, k,
               axes_[0].weight[static_cast<std::size_t>(i)] *
                   axes_[1].weight[static_cast<std::size_t>(j)] *
                   axes_[2].weight[static_cast<std::size_t>(k)]);
  }

  double mean_of(const base::Volume& volume, std::int64_t x, std::int64_t y) const {
    double sum = 0.0, weights = 0.0;
    for_voxels([&](std::int64_t i, std::int64_t j, std::int64_t k, double weight) {
      sum += weight * static_cast<double>(volume.at(x + i, y + j, k));
      weights += weight;
    });
    return sum / weights;
  }

  // The halves are the real and the imaginary part of what was transformed, as in fsc.cc.
  std::array<ShellSums, kShells + 2> sums() const {
    std::array<ShellSums, kShells + 2> sums;
    const auto value = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
      const kiss_fft_cpx& c = transformed_[static_cast<std::size_t>((z * kSide + y) * kSide + x)];
      return std::complex<double>(static_cast<double>(c.r), static_cast<double>(c.i));
    };
    std::size_t at = 0;
    for (std::int64_t z = 0; z < kSide; ++z) {
      for (std::int64_t y = 0; y < kSide; ++y) {
        for (std::int64_t x = 0; x < kSide; ++x, ++at) {
          if (shells_[at] == 0) continue;
          const std::complex<double> f = value(x, y, z);
          const std::complex<double> g =
              std::conj(value((kSide - x) % kSide, (kSide - y) % kSide, (kSide - z) % kSide));
          const std::complex<double> a = 0.5 * (f + g), b = std::complex(0.0, -0.5) * (f - g);
          sums[shells_[at]] +=
              {a.real() * b.real() + a.imag() * b.imag(), std::norm(a), std::norm(b), 1};
        }
      }
    }
    return sums;
  }

  const std::array<WindowAxis, 3>& axes_;
  std::span<const std::uint8_t> shells_;
  std::unique_ptr<void, decltype(&std::free)> plan_;
  std::vector<kiss_fft_cpx> values_, transformed_;
};

// The place of a voxel between two windows of an axis.
struct Between {
  std::size_t low = 0, high = 0;
  float part = 0.0f;  // of the way to `high`
};
Between between(const std::vector<double>& centres, std::int64_t voxel) {
  const double at = static_cast<double>(voxel) + 0.5;
  const auto next = std::ranges::upper_bound(centres, at);
  if (next == centres.begin()) return {};
  const auto high = static_cast<std::size_t>(next - centres.begin());
  if (next == centres.end()) return {high - 1, high - 1, 0.0f};
  const double step = *next - centres[high - 1];
  return {high - 1, high, static_cast<float>((at - centres[high - 1]) / step)};
}

}  // namespace

float LocalResolution::at(std::int64_t x, std::int64_t y, std::int64_t z) const {
  const Between bx = between(centre_px[0], x), by = between(centre_px[1], y),
                bz = between(centre_px[2], z);
  const std::size_t nx = centre_px[0].size(), ny = centre_px[1].size();
  const auto along_x = [&](std::size_t j, std::size_t k) {
    const float* row = frequency.data() + (k * ny + j) * nx;
    return std::lerp(row[bx.low], row[bx.high], bx.part);
  };
  const auto along_y = [&](std::size_t k) {
    return std::lerp(along_x(by.low, k), along_x(by.high, k), by.part);
  };
  return std::lerp(along_y(bz.low), along_y(bz.high), bz.part);
}

double LocalResolution::percentile_px(double per_cent) const {
  std::vector<float> lengths;
  for (const float f : frequency) lengths.push_back(1.0f / f);
  return base::percentile(std::move(lengths), per_cent);
}

LocalResolution local_resolution(const std::filesystem::path& first,
                                 const std::filesystem::path& second, const TiltRange& tilts) {
  const base::TraceSpan span("local resolution");
  const io::MrcReader a(first), b(second);
  TOMOFIELD_CHECK(whole_box(a) == whole_box(b), "halves have one size");
  const std::array<WindowAxis, 3> axes{windows_along(a.header().nx), windows_along(a.header().ny),
                                       windows_along(a.header().nz)};
  const std::vector<std::uint8_t> shells = shells_of(tilts);
  LocalResolution found;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const std::int64_t begin : axes[axis].begin)
      found.centre_px[axis].push_back(static_cast<double>(begin) +
                                      static_cast<double>(axes[axis].length) / 2);
  const auto nx = std::ssize(axes[0].begin), ny = std::ssize(axes[1].begin);
  found.frequency.resize(axes[0].begin.size() * axes[1].begin.size() * axes[2].begin.size());
  float* next = found.frequency.data();
  for (const std::int64_t z : axes[2].begin) {
    for (std::int64_t j = 0; j < ny; j += kRowsOfWindows) {
      const std::span rows = std::span(axes[1].begin)
                                 .subspan(static_cast<std::size_t>(j))
                                 .first(static_cast<std::size_t>(std::min(kRowsOfWindows, ny - j)));
      const base::Box box{{0, rows.front(), z},
                          {a.header().nx, rows.back() + axes[1].length, z + axes[2].length}};
      const base::Volume slab_a = read_box(a, box), slab_b = read_box(b, box);
      base::parallel_for("correlate windows", std::ssize(rows), [&](std::int64_t row) {
        WindowCorrelation correlate(axes, shells);
        const std::int64_t y = rows[static_cast<std::size_t>(row)] - rows.front();
        for (std::int64_t i = 0; i < nx; ++i)
          next[row * nx + i] =
              correlate(slab_a, slab_b, axes[0].begin[static_cast<std::size_t>(i)], y);
      });
      next += std::ssize(rows) * nx;
    }
  }
  return found;
}

void write_local_resolution(const LocalResolution& resolution, const std::filesystem::path& like,
                            const std::filesystem::path& path) {
  const io::MrcReader file(like);
  const std::int64_t nx = file.header().nx, ny = file.header().ny;
  const auto voxel_A = static_cast<float>(io::cubic_voxel_size_A(file.header(), like));
  io::MrcWriter map(path, map_like(file.header(), "local resolution in A"));
  base::parallel_for("write resolution", file.header().nz, [&](std::int64_t z) {
    std::vector<float> section;
    section.reserve(static_cast<std::size_t>(nx * ny));
    for (std::int64_t y = 0; y < ny; ++y)
      for (std::int64_t x = 0; x < nx; ++x) section.push_back(voxel_A / resolution.at(x, y, z));
    map.write_section(z, section);
  });
  map.close();
}

std::size_t local_resolution_memory(const base::Shape3& shape) {
  const std::int64_t rows = std::min(shape.ny, kSide + kRowsOfWindows * kResolutionStep);
  const std::size_t slabs = 2 * base::Shape3{shape.nx, rows, std::min(shape.nz, kSide)}.voxels();
  const auto of_thread = static_cast<std::size_t>(3 * kWindowVoxels) * 2;
  return sizeof(float) * (slabs + static_cast<std::size_t>(base::thread_count()) * of_thread);
}

}  // namespace tomofield::evaluate
