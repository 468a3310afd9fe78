#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "tilt_series/decode_view.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Facts that are checked in a view; integers, to be summed over processes.
struct ViewCheck {
  std::int64_t num_not_finite = 0;
  std::int64_t num_bad = 0;
  std::int64_t num_masked = 0;  ///< by --mask
  std::int64_t is_constant = 0;
  std::int64_t has_contrast = 0;  ///< two measurements differ
};

ViewCheck check_view(const PixelCensus& census, const MaskedImage& image);

/// Throws Error if no view of a stack can be used, as its numbers are in another scale.
void require_plausible_scale(std::span<const ViewCheck> found, const std::string& stack,
                             std::int64_t num_pixels);

/// Warns if a mask leaves out no pixel of any view, or most of the `num_pixels` of the views.
void warn_of_mask(std::span<const ViewCheck> found,
                  const std::optional<std::filesystem::path>& mask, std::int64_t num_pixels);

/// Throws Error if a view cannot be used, and warns of pixels that are NaN or infinite. `name`
/// names the view, `section` is its number counted from 1, and it has `num_pixels` as recorded.
void require_usable(const ViewCheck& found, const std::string& name, std::int64_t section,
                    std::int64_t num_pixels);

}  // namespace tomofield::tilt_series
