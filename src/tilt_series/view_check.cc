#include "tilt_series/view_check.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/log.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

constexpr double kMaxPartNotFinite = 0.01;

double part_not_finite(const ViewCheck& found, std::int64_t num_pixels) {
  return static_cast<double>(found.num_not_finite) / static_cast<double>(num_pixels);
}

// Tells whether two measurements differ.
bool has_contrast(const MaskedImage& image) {
  const float* first = nullptr;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!image.valid[i]) continue;
    if (first != nullptr && image.values[i] != *first) return true;
    if (first == nullptr) first = &image.values[i];
  }
  return false;
}

}  // namespace

ViewCheck check_view(const PixelCensus& census, const MaskedImage& image) {
  return {census.num_not_finite, census.num_bad, census.num_masked, census.is_constant,
          has_contrast(image)};
}

void require_plausible_scale(std::span<const ViewCheck> found, const std::string& stack,
                             std::int64_t num_pixels) {
  const auto is_beyond = [&](const ViewCheck& view) {
    return part_not_finite(view, num_pixels) > kMaxPartNotFinite;
  };
  const char* const advice =
      "fill or crop what is empty in all views, or, if its numbers are in a scale that cannot be "
      "used, multiply the stack by a factor";
  if (std::ranges::all_of(found, is_beyond))
    throw Error(
        fmt::format("in every view of '{}' more than 1 % of the pixels are NaN, infinite or beyond "
                    "±{:.0e}: {}",
                    stack, static_cast<double>(kLargestPixelValue), advice));
  if (std::ranges::all_of(found, &ViewCheck::is_constant))
    throw Error(
        fmt::format("in every view of '{}' all pixels have the same value, or they differ by less "
                    "than {:.0e}: {}",
                    stack, static_cast<double>(kSmallestDifference), advice));
}

void warn_of_mask(std::span<const ViewCheck> found,
                  const std::optional<std::filesystem::path>& mask, std::int64_t num_pixels) {
  constexpr double kLargestPart = 0.8;
  if (!mask) return;
  double sum = 0;
  for (const ViewCheck& view : found) sum += static_cast<double>(view.num_masked);
  const double part = sum / (static_cast<double>(num_pixels) * static_cast<double>(found.size()));
  if (part > 0 && part <= kLargestPart) return;
  base::log_warning(fmt::format(
      "the mask '{}' {}: write 0 where a pixel is left out, and 1 elsewhere", mask->string(),
      part == 0 ? "has no pixel that is 0 in the views, so it leaves none out"
                : fmt::format("leaves out {:.3g} % of the pixels of the views", 100 * part)));
}

void require_usable(const ViewCheck& found, const std::string& name, std::int64_t section,
                    std::int64_t num_pixels) {
  const double part = part_not_finite(found, num_pixels);
  if (part > kMaxPartNotFinite) {
    throw Error(
        fmt::format("{} has {} NaN or infinite pixels (or beyond ±{:.0e}), {:.1f} % of all and "
                    "more than the 1 % that can be left out; repair it or give --exclude {}",
                    name, found.num_not_finite, static_cast<double>(kLargestPixelValue),
                    100.0 * part, section));
  }
  if (found.is_constant) {
    throw Error(
        fmt::format("{} is constant: every pixel has the same value, or they differ by less than "
                    "{:.0e}; leave it out with --exclude {}",
                    name, static_cast<double>(kSmallestDifference), section));
  }
  if (!found.has_contrast) {
    throw Error(
        fmt::format("{} has no pixel left, or equal ones alone: its alignment moves it out of the "
                    "view, it is flat fill, or --mask is zero all over it; leave it out with "
                    "--exclude {}",
                    name, section));
  }
  if (found.num_not_finite > 0) {
    base::log_warning(
        fmt::format("{} has {} NaN or infinite pixels (or beyond ±{:.0e}), which are left out",
                    name, found.num_not_finite, static_cast<double>(kLargestPixelValue)));
  }
}

}  // namespace tomofield::tilt_series
