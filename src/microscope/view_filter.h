#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "fourier/real_transform.h"
#include "microscope/ctf.h"
#include "microscope/line_extension.h"
#include "microscope/view_transfer.h"

namespace tomofield::microscope {

/// A smooth function on an interval as values at equal distances, which is much faster than the
/// function itself where it is needed for every pixel.
class InterpolatedTable {
 public:
  /// Takes the values of `function` at `num_steps` + 1 places from 0 to `end`.
  template <typename Function>
  InterpolatedTable(double end, std::size_t num_steps, const Function& function)
      : steps_per_unit_(static_cast<double>(num_steps) / end) {
    values_.reserve(num_steps + 2);
    for (std::size_t i = 0; i <= num_steps; ++i)
      values_.push_back(static_cast<float>(function(static_cast<double>(i) / steps_per_unit_)));
    values_.push_back(values_.back());  // rounding may take `end` for a place behind it
  }

  /// Interpolates linearly at a place from 0 to the end.
  float operator()(double at) const {
    const double steps = at * steps_per_unit_;
    const auto i = static_cast<std::size_t>(steps);
    const auto part = static_cast<float>(steps - static_cast<double>(i));
    return values_[i] + part * (values_[i + 1] - values_[i]);
  }

 private:
  double steps_per_unit_;
  std::vector<float> values_;
};

/// Returns how far the transfer moves what is in an image of this size, in pixels.
std::int64_t reach_px(const ViewTransfer& view, std::int64_t width, std::int64_t height);

/// The filter that takes the contrast transfer of a view back, at each place by the transfer H of
/// its defocus: the sign of H (phase flipping), H itself, or Wiener's filter H / (H² + 0.1).
enum class CtfCorrection { kFlip, kMultiply, kWiener };

/// Applies the transfer H of a view to images [y, x], and its transpose. H is −CTF times what
/// radiation damage leaves of the signal (signal_after()). Thread-safe; works on one thread.
///
/// Where the defocus changes over the image, each pixel of the projection is spread with the
/// defocus at its own place: with hat functions w_s of the local defocus, H = Σ_s H_s w_s. Their
/// spacing is 1 / (4 λ k²), where k is the Nyquist frequency. There it changes the phase of H_s by
/// π / 4, so the interpolation errs by at most 8 percent; at half of that frequency by 0.5.
///
/// The image is extended on all sides (LineExtension), so that nothing wraps around. Within
/// reach_px() of its border the result depends on what the extension puts outside: give a wider
/// projection, where one is known. The extension repeats what lies near the border, so that ‖H‖² is
/// not at most 1, as |CTF| is, but up to 1.1.
class ViewFilter {
 public:
  /// A filter keeps computed transfers if they take no more bytes than this.
  static constexpr std::size_t kMostKept = std::size_t{1} << 20;

  ViewFilter(std::int64_t width, std::int64_t height, const ViewTransfer& transfer);

  /// Returns H image.
  std::vector<float> apply(std::span<const float> image) const;
  /// Returns Hᵀ image: ⟨H a, b⟩ = ⟨a, Hᵀ b⟩.
  std::vector<float> apply_transpose(std::span<const float> image) const;

  /// Returns a view whose contrast transfer is corrected.
  std::vector<float> corrected(std::span<const float> view, CtfCorrection correction) const;

  /// Returns the number of defoci, one for each hat function.
  std::int64_t num_defoci() const { return num_defoci_; }

  /// Returns true if H leaves at least half of the mean of an image.
  bool passes_mean() const;

  /// Returns a bound of |H_s| at frequencies from one to another, in cycles a pixel, up to 1 / √2.
  double largest_transfer(double from, double to) const;

 private:
  using Image = fourier::RealTransform::Image;
  using Spectrum = fourier::RealTransform::Spectrum;

  // Multiplies a spectrum by a function of H_s, for all defoci, and adds each to an image by `add`.
  template <typename Factor, typename Add>
  void spread(const Spectrum& spectrum, const Factor& factor, const Add& add) const;
  Spectrum spectrum_of(std::span<const float> image) const;
  float computed_transfer(std::int64_t kx, std::int64_t ky, std::int64_t s) const;
  void compute_row(std::int64_t ky, std::int64_t s, std::span<float> row) const;
  void keep_transfers();
  template <typename Visit>
  void for_transfers(std::int64_t s, const Visit& visit) const;
  static constexpr std::int64_t kEverywhere = -1;  // in the place of s: w_s is 1
  void weigh_row(std::int64_t y, std::int64_t s, std::span<float> weights) const;
  void extend(std::span<const float> image, std::int64_t s, Image& extended) const;
  void add_folded(Image& extended, std::int64_t s, std::span<float> sum) const;
  double defocus_of(std::int64_t s) const { return first_defocus_A_ + defocus_step_A_ * double(s); }

  ViewTransfer view_;
  Ctf ctf_;
  double first_defocus_A_ = 0.0, defocus_step_A_ = 0.0;  // added to that of the view
  std::int64_t num_defoci_ = 1;
  LineExtension across_, along_;  // x and y
  fourier::RealTransform transform_;
  std::vector<double> kx_, ky_;   // frequencies of the transform, in cycles per Å
  std::vector<float> transfers_;  // H_s [s, ky, kx]; empty if they would take much memory
  InterpolatedTable signal_;      // what damage and the envelope leave, of the square of k
};

}  // namespace tomofield::microscope

namespace tomofield::base {

template <>
struct EnumNames<microscope::CtfCorrection> {
  static constexpr std::array kNames{std::pair{microscope::CtfCorrection::kFlip, "flip"},
                                     std::pair{microscope::CtfCorrection::kMultiply, "multiply"},
                                     std::pair{microscope::CtfCorrection::kWiener, "wiener"}};
};

}  // namespace tomofield::base
