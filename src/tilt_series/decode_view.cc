#include "tilt_series/decode_view.h"

#include <cmath>
#include <utility>

#include "tilt_series/masks/bad_pixels.h"
#include "tilt_series/masks/fill.h"
#include "tilt_series/masks/series_masks.h"
#include "tilt_series/resampling/align_image.h"
#include "tilt_series/resampling/band_limited_image.h"
#include "tilt_series/resampling/binning.h"

namespace tomofield::tilt_series {
namespace {

/// Marks pixels that are no usable numbers as no measurements, and counts them.
PixelCensus mask_unusable(MaskedImage* image) {
  PixelCensus census;
  const float* first_finite = nullptr;
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    if (!(std::fabs(image->values[i]) <= kLargestPixelValue)) {
      image->valid[i] = 0;
      image->values[i] = 0.0f;
      ++census.num_not_finite;
      continue;
    }
    if (first_finite == nullptr) first_finite = &image->values[i];
    if (std::fabs(image->values[i] - *first_finite) > kSmallestDifference) census.is_constant = 0;
  }
  return census;
}

}  // namespace

std::size_t decoding_memory(double raw_pixels, double bin_factor) {
  constexpr double kBytesPerPixel = 5;
  constexpr double kCopies = 3;
  const double binned = raw_pixels / (bin_factor * bin_factor);
  return static_cast<std::size_t>(kCopies * kBytesPerPixel * (raw_pixels + binned)) +
         BandLimitedImage::memory(raw_pixels);
}

ViewDecoder::ViewDecoder(const io::ImageStack& stack, const SeriesPlan& plan, Contrast contrast,
                         std::optional<io::MrcReader> mask)
    : stack_(stack), plan_(plan), contrast_(contrast), mask_(std::move(mask)) {}

std::int64_t ViewDecoder::recorded_width() const {
  return reduced_size(stack_.header().nx, plan_.bin_factor);
}
std::int64_t ViewDecoder::recorded_height() const {
  return reduced_size(stack_.header().ny, plan_.bin_factor);
}
std::int64_t ViewDecoder::aligned_width() const {
  return reduced_size(plan_.aligned_width, plan_.bin_factor);
}
std::int64_t ViewDecoder::aligned_height() const {
  return reduced_size(plan_.aligned_height, plan_.bin_factor);
}

std::size_t ViewDecoder::memory() const {
  const auto& header = stack_.header();
  return decoding_memory(static_cast<double>(header.nx * header.ny), plan_.bin_factor);
}

DecodedView ViewDecoder::decode(std::size_t view, Frames frames, PatternSearch* search) const {
  PixelCensus census;
  MaskedImage image = read_and_mask(view, census);
  if (search) search->add(view, image);
  DecodedView decoded = decode_masked(std::move(image), view, frames);
  decoded.census = census;
  return decoded;
}

DecodedView ViewDecoder::decode_half(Half half, const HalfStacks& halves, std::size_t view,
                                     Frames frames) const {
  MaskedImage image = read_masked(view);
  halves.read_section(half, plan_.views[view].view.section, image.values);
  for (std::size_t i = 0; i < image.values.size(); ++i)
    if (image.valid[i] == kNoMeasurement) image.values[i] = 0.0f;
  return decode_masked(std::move(image), view, frames);
}

MaskedImage ViewDecoder::read_masked(std::size_t view) const {
  PixelCensus census;
  return read_and_mask(view, census);
}

// Reads the section of a view and masks what is no measurement.
MaskedImage ViewDecoder::read_and_mask(std::size_t view, PixelCensus& census) const {
  const std::int64_t section = plan_.views[view].view.section;
  MaskedImage image(stack_.header().nx, stack_.header().ny);
  stack_.read_section(section, image.values);
  census = mask_unusable(&image);
  if (!plan_.is_raw) mask_fill(contrast_, &image);
  if (mask_) apply_mask(*mask_, section, &image);
  census.num_bad = mask_bad_pixels(&image);
  return image;
}

// Removes the fixed pattern, aligns and bins.
DecodedView ViewDecoder::decode_masked(MaskedImage image, std::size_t view, Frames frames) const {
  DecodedView decoded;
  pattern_.remove_from(view, &image);
  if (frames.recorded) decoded.recorded = frames.aligned ? binned(image) : binned(std::move(image));
  if (frames.aligned) decoded.aligned = binned(aligned(std::move(image), view));
  return decoded;
}

MaskedImage ViewDecoder::aligned(MaskedImage recorded, std::size_t view) const {
  const PlannedView& planned = plan_.views[view];
  const bool keeps_sizes =
      plan_.aligned_width == recorded.width && plan_.aligned_height == recorded.height;
  if (planned.raw_from_aligned.is_identity() && !planned.local && keeps_sizes) return recorded;
  return align_image(recorded, planned.raw_from_aligned, plan_.aligned_width, plan_.aligned_height,
                     planned.local);
}

MaskedImage ViewDecoder::binned(MaskedImage image) const {
  return plan_.bin_factor == 1.0 ? std::move(image) : reduce_image(image, plan_.bin_factor);
}

}  // namespace tomofield::tilt_series
