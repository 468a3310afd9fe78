#include "measurement/undecided_beads.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>
#include <vector>

#include "base/log.h"
#include "measurement/background.h"

namespace tomofield::measurement {
namespace {

using tilt_series::BeadMasking;
using tilt_series::MaskDisc;

// Writes down that the undecided beads are masked in `views`, and that nothing is undecided.
void record_masks(std::span<const int> views, const distributed::Communicator& processes,
                  Measurement& measurement) {
  for (const int v : views) {
    const auto view = static_cast<std::size_t>(v);
    measurement.masks.beads_masked[view] += measurement.undecided_beads[view].size();
  }
  const bool are_all = static_cast<int>(views.size()) == measurement.geometry.num_views();
  measurement.masks.bead_masking = are_all ? BeadMasking::kMasked : BeadMasking::kUnmasked;
  measurement.masked_part = measurement.rays->masked_parts(processes);
  measurement.undecided_beads.clear();
}

std::vector<int> all_views(const Measurement& measurement) {
  std::vector<int> views(measurement.undecided_beads.size());
  std::iota(views.begin(), views.end(), 0);
  return views;
}

}  // namespace

void hide_beads(Measurement& measurement, const distributed::Communicator& processes) {
  if (measurement.undecided_beads.empty()) return;
  own_rays(measurement).hide(measurement.undecided_beads);
  record_masks(all_views(measurement), processes, measurement);
  base::log_warning(fmt::format(
      "the {} are masked: {:.1f} % of all rays carry no loss, and what they show is not in the "
      "tomogram (--bead-diameter 0 keeps them if they are the specimen)",
      describe_beads(measurement.masks),
      100 * std::reduce(measurement.masked_part.begin(), measurement.masked_part.end()) /
          measurement.geometry.num_views()));
}

void keep_beads(Measurement& measurement) {
  if (measurement.undecided_beads.empty()) return;
  measurement.undecided_beads.clear();
  measurement.masks.bead_masking = BeadMasking::kUnmasked;
  base::log_info(fmt::format("the {} are not masked; --bead-diameter {:.3g} masks them",
                             describe_beads(measurement.masks),
                             measurement.masks.bead_diameter_A / 10));
}

Measurement with_beads_hidden(const Measurement& measurement, std::span<const int> views) {
  if (measurement.undecided_beads.empty()) return measurement;
  std::vector<std::vector<MaskDisc>> discs(measurement.undecided_beads.size());
  for (const int v : views) {
    const auto view = static_cast<std::size_t>(v);
    discs[view] = measurement.undecided_beads[view];
  }
  Measurement copy = with_own_rays(measurement);
  own_rays(copy).hide(discs);
  record_masks(views, distributed::Communicator::alone(), copy);
  return copy;
}

}  // namespace tomofield::measurement
