#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fourier/image_transform.h"
#include "microscope/ctf.h"
#include "microscope/defocus_slope.h"
#include "microscope/interpolated_table.h"
#include "microscope/line_extension.h"

namespace tomofield::microscope {

/// Describes what turns a projection of density, in which dense is high, into a view.
struct ViewTransfer {
  Optics optics;
  io::Defocus defocus;        ///< with its angle in the image that is filtered
  DefocusSlope slope;         ///< over that image
  double exposure = 0.0;      ///< electrons per Å² (Exposure::at_middle()); 0: no damage
  double pixel_size_A = 1.0;  ///< of that image
  bool is_flipped = false;    ///< the view's phases were flipped: |CTF| instead of −CTF
};

/// Returns how far the transfer moves what is in an image of this size, in pixels.
std::int64_t reach_px(const ViewTransfer& view, std::int64_t width, std::int64_t height);

/// Applies the transfer H of a view to images [y, x], and its transpose. H is −CTF times what
/// radiation damage leaves of the signal (signal_after()). Thread-safe; works on one thread.
///
/// Where the defocus changes over the image, each pixel of the projection is spread with the
/// defocus at its own place: with hat functions w_s of the local defocus, H = Σ_s H_s w_s. Their
/// spacing is 1 / (8 λ k²), where k is the Nyquist frequency. There it changes the phase of H_s by
/// π / 8, so the interpolation errs by at most 2 percent.
///
/// The image is extended on all sides (LineExtension), so that nothing wraps around. Within
/// reach_px() of its border the result depends on what the extension puts outside: give a wider
/// projection, where one is known. The extension repeats what lies near the border, so that ‖H‖² is
/// not at most 1, as |CTF| is, but up to 1.1.
class ViewFilter {
 public:
  ViewFilter(std::int64_t width, std::int64_t height, const ViewTransfer& transfer);

  /// Returns H image.
  std::vector<float> apply(std::span<const float> image) const;
  /// Returns Hᵀ image: ⟨H a, b⟩ = ⟨a, Hᵀ b⟩.
  std::vector<float> apply_transpose(std::span<const float> image) const;

  /// Returns the number of defoci, one for each hat function.
  std::int64_t num_defoci() const { return num_defoci_; }

 private:
  using Image = fourier::ImageTransform::Image;

  // A frequency k of the transform, and −k.
  struct Frequency {
    std::int64_t x, y;
    std::size_t at, opposite;  // their places in a spectrum
    std::size_t number;        // in the order in which they are visited
  };
  float transfer(const Frequency& k, std::int64_t s) const;
  float computed_transfer(const Frequency& k, std::int64_t s) const;
  void keep_transfers();
  double defocus_of(std::int64_t s) const { return first_defocus_A_ + defocus_step_A_ * double(s); }
  template <typename Visit>
  void for_opposite_frequencies(const Visit& visit) const;
  float weight_at(std::int64_t x, std::int64_t y, std::int64_t s) const;
  Image extended_pair(std::span<const float> image, std::int64_t s) const;
  void add_filtered_pair(const Image& pair, std::int64_t s, Image& sum) const;
  void add_folded_pair(const Image& pair, std::int64_t s, std::vector<float>& sum) const;

  ViewTransfer view_;
  Ctf ctf_;
  double first_defocus_A_ = 0.0, defocus_step_A_ = 0.0;  // added to that of the view
  std::int64_t num_defoci_ = 1;
  LineExtension across_, along_;  // x and y
  fourier::ImageTransform transform_;
  std::vector<double> kx_, ky_;   // frequencies of the transform, in cycles per Å
  std::vector<float> transfers_;  // H_s [s, number of k]; empty if they would take much memory
  InterpolatedTable signal_;      // what damage and the envelope leave, of the square of k
};

}  // namespace tomofield::microscope
