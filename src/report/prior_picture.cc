#include "report/prior_picture.h"

#include <cstddef>
#include <vector>

#include "report/contrast.h"
#include "report/trial_sections.h"

namespace tomofield::report {
namespace {

// Returns what `with` has more than `without`, around the middle of the contrast of that: where
// nothing changes, it is a middle grey.
tune::Section difference_of(const tune::Section& with, const tune::Section& without) {
  tune::Section difference = with;
  const Contrast contrast = contrast_of(without.values);
  const auto middle = static_cast<float>((contrast.black + contrast.white) / 2);
  for (std::size_t i = 0; i < difference.values.size(); ++i)
    difference.values[i] += middle - without.values[i];
  return difference;
}

}  // namespace

void write_prior_picture(const tune::TunedFit& tuned, double output_scale,
                         const std::filesystem::path& path) {
  std::vector<CaptionedSection> shown;
  if (!tuned.last_trials.empty() && !tuned.last_trials.front().section.values.empty()) {
    const tune::Section& without = tuned.last_trials.front().section;
    const tune::Section& with = tuned.last_trials.back().section;
    shown = {{without, "Total variation alone"},
             {with, "With the learned prior"},
             {difference_of(with, without), "What the prior adds"}};
  }
  draw_sections(shown, 0, output_scale, path);
}

}  // namespace tomofield::report
