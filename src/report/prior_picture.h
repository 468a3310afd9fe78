#pragma once

#include <filesystem>

#include "tune/trial_settings.h"

namespace tomofield::report {

/// Draws what the learned prior changes: a section of the trial without it, of the trial with it,
/// and their difference (trial_sections.h). Removes the file and draws nothing if the trials have
/// no sections, as those that a resumed run reads.
void write_prior_picture(const tune::TunedFit& tuned, double output_scale,
                         const std::filesystem::path& path);

}  // namespace tomofield::report
