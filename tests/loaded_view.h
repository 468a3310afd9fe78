#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <vector>

#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/error.h"

namespace tomofield::testing {

/// Holds the pixels of one view and their mask, [y, x].
struct LoadedView {
  std::int64_t width;
  std::vector<float> image;
  std::vector<std::uint8_t> valid;
};

inline LoadedView load(const tilt_series::TiltSeries& series, std::size_t view) {
  const auto pixels = static_cast<std::size_t>(series.width() * series.height());
  LoadedView loaded{series.width(), std::vector<float>(pixels), std::vector<std::uint8_t>(pixels)};
  series.read_view(view, loaded.image, loaded.valid);
  return loaded;
}

/// Writes a small bright stack of 16 × 12 pixels and its angles, and returns the options that read
/// them.
inline tilt_series::TiltSeriesOptions small_series(const ScratchDirectory& scratch,
                                                   std::int64_t num_sections = 3) {
  tilt_series::TiltSeriesOptions options;
  options.stack = write_stack(scratch / "a.st", 16, 12, num_sections, some_value);
  std::string angles;
  for (std::int64_t i = 0; i < num_sections; ++i) angles += fmt::format("{}\n", 10 * i - 20);
  options.tlt = scratch.write("a.tlt", angles);
  options.contrast = Contrast::kBright;
  return options;
}

/// Returns why a series is refused, or an empty text.
inline std::string refusal(const tilt_series::TiltSeriesOptions& options) {
  return message_of<Error>([&] { tilt_series::TiltSeries series(options); });
}

}  // namespace tomofield::testing
