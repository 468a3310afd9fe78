// Makes the surrogates of filtered views that the steps of a fit follow.

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <vector>

#include "base/threads/parallel.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "measurement/surrogate_views.h"

namespace tomofield::fit {
namespace {

// Surrogates are made this often in an epoch. With fewer they are cheaper, because a
// prediction decodes the whole volume, but the fit follows older surrogates (docs/results/ctf.md).
constexpr int kSurrogatesInEpoch = 2;

// Predictions of views that surrogates are made from are at most so large at a time, or one view.
constexpr std::size_t kPredictionBytes = std::size_t{256} << 20;

// Returns after how many steps new surrogates are made in an epoch of `steps_an_epoch`.
int steps_of_surrogates_in(int steps_an_epoch) {
  return (steps_an_epoch + kSurrogatesInEpoch - 1) / kSurrogatesInEpoch;
}

}  // namespace

std::int64_t Fit::last_stop_before(std::int64_t step) const {
  const std::int64_t last = step - 1;
  return filters_.empty() ? last : last - last % steps_per_epoch() % steps_of_surrogates();
}

// Returns after how many steps new surrogates are made; after an epoch they are made in any case.
int Fit::steps_of_surrogates() const { return steps_of_surrogates_in(steps_per_epoch()); }

bool Fit::needs_surrogates() const {
  const std::int64_t in_epoch = progress_.step % steps_per_epoch();
  return !filters_.empty() && (!surrogates_ || in_epoch % steps_of_surrogates() == 0);
}

// Makes the surrogates of the views of the next steps from the present field.
void Fit::make_surrogates() {
  const base::TraceSpan span("make surrogate views");
  std::vector<int> views;
  const std::int64_t left = steps_per_epoch() - progress_.step % steps_per_epoch();
  for (std::int64_t s = 0; s < std::min<std::int64_t>(steps_of_surrogates(), left); ++s)
    std::ranges::copy(views_of_step(progress_.step + s), std::back_inserter(views));
  surrogates_.reset();  // its successor needs the memory
  surrogates_.emplace(*binned_->rays, views, progress_.views);
  const auto at_once = std::max<std::size_t>(
      1, kPredictionBytes / measurement::bytes_of_prediction(binned_->rays->shape()));
  for (std::size_t first = 0; first < views.size(); first += at_once) {
    const auto some = std::span(views).subspan(first, std::min(at_once, views.size() - first));
    surrogates_->set(filters_, some, project(some), processes());
  }
}

std::size_t surrogate_memory(const measurement::SlabViews::Shape& own,
                             const measurement::SlabViews::Shape& all, int steps_an_epoch,
                             int slabs_in_use) {
  // A view that is filtered: its copy, its residual, the extended image and two spectra.
  constexpr std::size_t kImagesOfFilter = 8;
  const int steps = steps_of_surrogates_in(steps_an_epoch);
  measurement::SlabViews::Shape surrogates = own;
  surrogates.num_views = (own.num_views * static_cast<std::size_t>(steps) +
                          static_cast<std::size_t>(steps_an_epoch) - 1) /
                         static_cast<std::size_t>(steps_an_epoch);
  const std::size_t of_view = measurement::bytes_of_prediction(all);
  const std::size_t predicted =
      std::max(of_view, std::min(kPredictionBytes, surrogates.num_views * of_view));
  const std::size_t filtering =
      static_cast<std::size_t>(base::thread_count()) * (kImagesOfFilter / 2) * of_view;
  return measurement::SlabViews::resident_memory(surrogates, slabs_in_use) + predicted + filtering +
         all.num_views * microscope::ViewFilter::kMostKept;
}

}  // namespace tomofield::fit
