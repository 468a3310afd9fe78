#pragma once

#include <filesystem>

#include "reconstruct/trial_settings.h"

namespace tomofield::reconstruction {

/// Draws how much worse than the best each trial predicts the held-out views, over the weight of
/// total variation: a curve for each penalty, and a point for each trial with other corrections of
/// the views. Bars are two standard errors long on either side. Replaces `path`. Throws Error if it
/// cannot be written.
void write_choice_plot(const TunedFit& tuned, const std::filesystem::path& path);

}  // namespace tomofield::reconstruction
