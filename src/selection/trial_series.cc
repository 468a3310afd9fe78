#include "selection/trial_series.h"

#include <fmt/format.h>

#include <algorithm>

#include "measurement/held_out.h"
#include "tomofield/error.h"

namespace tomofield::selection {
namespace {

// Every so-manieth view is predicted: an eighth, or five of fewer than forty, since two or three
// views tell noise from a better setting badly.
constexpr int kMostEvery = 8, kLeastEvery = 3, kWanted = 5;
constexpr int kFewestViews = 6;

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
  if (count < kFewestViews) {
    throw Error(fmt::format(
        "{} views are too few to choose settings by some of them: give the settings instead of "
        "--tune{}",
        count, scored.empty() ? "" : ", or a larger --hold-out"));
  }
  views.predicted =
      chosen(views.fitted_or_predicted,
             measurement::held_out_views(chosen(tilt_deg, views.fitted_or_predicted),
                                         std::clamp(count / kWanted, kLeastEvery, kMostEvery)));
  return views;
}

TrialSeries make_trial_series(const geometry::TiltGeometry& geometry,
                              const std::vector<double>& noise_sigma,
                              const measurement::SlabViews& rays, const std::vector<int>& scored,
                              std::int64_t most_rows, const distributed::Communicator& processes) {
  TrialSeries trial{.views = trial_views(geometry.tilt_deg, scored),
                    .held_out = {},
                    .geometry = geometry,
                    .noise_sigma = {},
                    .rays = nullptr};
  const std::vector<int>& views = trial.views.fitted_or_predicted;
  for (const int view : trial.views.predicted) {
    trial.held_out.push_back(
        static_cast<int>(std::ranges::lower_bound(views, view) - views.begin()));
  }
  trial.geometry.tilt_deg = chosen(geometry.tilt_deg, views);
  trial.noise_sigma = chosen(noise_sigma, views);
  trial.rays = rays.middle_rows(most_rows, views, processes);
  return trial;
}

}  // namespace tomofield::selection
