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

ViewDecoder::ViewDecoder(PlannedSeries series) : series_(std::move(series)) {
  if (series_.options().mask) mask_ = open_mask(*series_.options().mask, series_.stack());
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
  halves.read_section(half, series_.plan().views[view].view.section, image.values);
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
  const std::int64_t section = series_.plan().views[view].view.section;
  const io::ImageStack& stack = series_.stack();
  MaskedImage image(stack.header().nx, stack.header().ny);
  stack.read_section(section, image.values);
  census = mask_unusable(&image);
  if (!series_.plan().is_raw) mask_fill(series_.options().contrast, &image);
  if (mask_) census.num_masked = apply_mask(*mask_, section, &image);
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
  const SeriesPlan& plan = series_.plan();
  const PlannedView& planned = plan.views[view];
  const bool keeps_sizes =
      plan.aligned_width == recorded.width && plan.aligned_height == recorded.height;
  if (planned.raw_from_aligned.is_identity() && !planned.local && keeps_sizes) return recorded;
  return align_image(recorded, planned.raw_from_aligned, plan.aligned_width, plan.aligned_height,
                     planned.local);
}

MaskedImage ViewDecoder::binned(MaskedImage image) const {
  const double factor = series_.bin_factor();
  return factor == 1.0 ? std::move(image) : reduce_image(image, factor);
}

}  // namespace tomofield::tilt_series
