#include "tune/trial_measurement.h"

#include <fmt/format.h>

#include <algorithm>

#include "measurement/held_out.h"
#include "tomofield/error.h"

namespace tomofield::tune {
namespace {

// Every eighth view is predicted, or about five of fewer than forty views, since two or three views
// cannot tell noise from a better setting. At least two fitted views lie between two predicted
// ones.
constexpr int kMaxEvery = 8, kMinEvery = 3, kWanted = 5;
constexpr int kMinViews = 6;

template <typename T>
std::vector<T> chosen(const std::vector<T>& values, const std::vector<int>& indices) {
  std::vector<T> result;
  for (const int i : indices) result.push_back(values[static_cast<std::size_t>(i)]);
  return result;
}

}  // namespace

TrialViews trial_views(const std::vector<double>& tilt_deg, const std::vector<int>& scored) {
  TrialViews views;
  for (int v = 0; v < static_cast<int>(tilt_deg.size()); ++v) {
    if (!std::ranges::binary_search(scored, v)) views.fitted_or_predicted.push_back(v);
  }
  const int count = static_cast<int>(views.fitted_or_predicted.size());
  if (count < kMinViews) {
    throw Error(fmt::format(
        "{} views are too few to choose settings by some of them: give the settings instead of "
        "--tune{}",
        count, scored.empty() ? "" : ", or a larger --hold-out"));
  }
  views.predicted =
      chosen(views.fitted_or_predicted,
             measurement::held_out_views(chosen(tilt_deg, views.fitted_or_predicted),
                                         std::clamp(count / kWanted, kMinEvery, kMaxEvery)));
  return views;
}

measurement::Measurement trial_measurement(const measurement::Measurement& whole,
                                           const TrialViews& views, std::int64_t max_rows,
                                           const distributed::Communicator& processes) {
  measurement::Measurement with_predicted_held_out = whole;
  with_predicted_held_out.held_out = views.predicted;
  return middle_rows(with_predicted_held_out, max_rows, views.fitted_or_predicted, processes);
}

}  // namespace tomofield::tune
