#include "align/alignment.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "align/trial.h"
#include "base/percentile.h"

namespace tomofield::align {
namespace {

// A view that resembles its projection so much less than the others is not of this specimen.
constexpr double kUnalike = 0.2;

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Returns the views whose correlation with their projections is far below the median.
std::vector<int> unalike_views(const std::vector<ViewAgreement>& agreement) {
  std::vector<double> correlations;
  for (const ViewAgreement& view : agreement) correlations.push_back(view.correlation);
  const double median = base::percentile(correlations, 50);
  std::vector<int> views;
  for (std::size_t v = 0; v < agreement.size(); ++v)
    if (agreement[v].correlation < kUnalike * median) views.push_back(static_cast<int>(v));
  return views;
}

void judge(const std::vector<double>& before, const std::vector<double>& after,
           Alignment& alignment) {
  std::vector<double> gains;
  double squares = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) gains.push_back(before[i] - after[i]);
  alignment.error_before = mean_of(before);
  alignment.error_after = mean_of(after);
  alignment.gain = mean_of(gains);
  for (const double gain : gains) squares += std::pow(gain - alignment.gain, 2);
  const auto n = static_cast<double>(gains.size());
  alignment.gain_error = n > 1 ? std::sqrt(squares / (n - 1) / n) : 0.0;
  alignment.is_accepted = alignment.gain > alignment.gain_error;
}

}  // namespace

Alignment refine_alignment(const JointProblem& problem,
                           const distributed::Communicator& processes) {
  const std::vector<geometry::ViewCorrection> none(problem.recorded.views().size());
  Alignment alignment;
  alignment.joint = align_jointly(problem, none, processes);
  if (alignment.joint.was_stopped) return alignment;
  alignment.unaligned = unalike_views(alignment.joint.agreement);
  judge(errors_of_held_out_views(problem, none, processes),
        errors_of_held_out_views(problem, alignment.joint.corrections, processes), alignment);
  alignment.corrections = alignment.is_accepted ? alignment.joint.corrections : none;
  return alignment;
}

}  // namespace tomofield::align
