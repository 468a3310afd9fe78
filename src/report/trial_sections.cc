#include "report/trial_sections.h"

#include <algorithm>
#include <cstdint>
#include <system_error>
#include <utility>

#include "report/canvas.h"
#include "report/contrast.h"
#include "report/slice.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kCaption_px = 28;  // height of the caption above a section
constexpr std::int64_t kTextAboveSection_px = 6;

// Draws a section with its caption above it; `bottom` is the row of its lower edge.
void draw_section(const CaptionedSection& shown, double output_scale, const GreyScale& scale,
                  std::int64_t zoom, std::int64_t bottom, Canvas& canvas) {
  const tune::Section& section = shown.section;
  const auto height = std::ssize(section.values) / section.width;
  for (std::int64_t y = 0; y < height; ++y) {
    for (std::int64_t x = 0; x < section.width; ++x) {
      const std::uint8_t grey = scale.grey(
          output_scale *
          static_cast<double>(section.values[static_cast<std::size_t>(y * section.width + x)]));
      canvas.fill(x * zoom, bottom + y * zoom, (x + 1) * zoom, bottom + (y + 1) * zoom,
                  {grey, grey, grey});
    }
  }
  draw_text(canvas, 0, bottom + height * zoom + kTextAboveSection_px, shown.caption, kBlack);
}

GreyScale scale_of(const tune::Section& section, double output_scale) {
  std::vector<float> values = section.values;
  for (float& value : values) value *= static_cast<float>(output_scale);
  return GreyScale(contrast_of(std::move(values)));
}

}  // namespace

void draw_sections(const std::vector<CaptionedSection>& shown, std::size_t reference,
                   double output_scale, const std::filesystem::path& path) {
  const bool has_sections = std::ranges::none_of(
      shown, [](const CaptionedSection& one) { return one.section.values.empty(); });
  if (shown.empty() || !has_sections) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    return;
  }
  const tune::Section& section = shown.front().section;
  const std::int64_t zoom = picture_zoom(section.width, section.width);
  const std::int64_t height = std::ssize(section.values) / section.width * zoom + kCaption_px;
  Canvas canvas(section.width * zoom, height * std::ssize(shown), kWhite);
  const GreyScale scale = scale_of(shown[reference].section, output_scale);
  for (std::size_t i = 0; i < shown.size(); ++i)
    draw_section(shown[i], output_scale, scale, zoom,
                 height * (std::ssize(shown) - 1 - static_cast<std::int64_t>(i)), canvas);
  canvas.write(path);
}

}  // namespace tomofield::report
