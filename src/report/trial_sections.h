#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tune/trials.h"

namespace tomofield::report {

/// A section of a trial, and the line above it.
struct CaptionedSection {
  tune::Section section;
  std::string caption;
};

/// Draws sections of one size under each other, all in the contrast of the one with the number
/// `reference` (report/contrast.h). Densities are multiplied by `output_scale`, so that greys are
/// those of the tomogram. Replaces the file. Removes it and returns without a picture if there are
/// no sections or one of them is empty.
void draw_sections(const std::vector<CaptionedSection>& shown, std::size_t reference,
                   double output_scale, const std::filesystem::path& path);

}  // namespace tomofield::report
