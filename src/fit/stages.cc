#include "fit/stages.h"

#include <algorithm>
#include <cmath>

#include "fit/constants.h"
#include "kernels/lanes.h"

namespace tomofield::fit {
namespace {

// The cost of a step of plain vertices, in steps of the usual factors. It serves to estimate the
// time that is left.
constexpr double kVertexCost = 0.4;

// Returns the cost of a step with pixels `bin` times as wide, in steps at full resolution. A part
// of it is for samples of rays, the rest for vertices (docs/results/speed.md).
double cost_of_bin(int bin, double vertex_spacing) {
  // The time of vertices over that of samples, with 61 views and a vertex a pixel.
  constexpr double kVerticesOverSamples = 2.0;
  const double vertices = kVerticesOverSamples / std::pow(vertex_spacing, 3);
  // The field has as many vertices as the pixels resolve (Domain::shape_in).
  const double fewer = std::pow(std::max(1.0, bin * std::min(1.0, 1.0 / vertex_spacing)), 3);
  return (1.0 / (bin * bin * bin) + vertices / fewer) / (1.0 + vertices);
}

// Returns the bins of the coarse stages, ascending: powers of two up to coarse_bin at which no slab
// straddles two leaves, at most one for each coarse epoch. An adaptive tree has bin 2 alone: its
// leaves may change in the first stage alone, which should resolve the structure well.
std::vector<int> coarse_bins(const FieldOptions& field, const FitOptions& fit) {
  std::vector<int> bins;
  if (fit.engine != Engine::kSlab) return bins;
  const bool is_adaptive = field.tree == TreeKind::kAdaptive;
  const bool may_halve = is_adaptive && field.leaf_size % (2 * kernels::kLanes) == 0;
  const int smallest_leaf = may_halve ? field.leaf_size / 2 : *field.leaf_size;
  const int max_bin = is_adaptive ? std::min(fit.coarse_bin, 2) : fit.coarse_bin;
  const int largest_bin = std::min(max_bin, smallest_leaf / kernels::kLanes);
  for (int bin = 2; bin <= largest_bin && smallest_leaf % (bin * kernels::kLanes) == 0; bin *= 2) {
    if (std::ssize(bins) < fit.coarse_epochs) bins.push_back(bin);
  }
  return bins;
}

// Adds the stages of the learned prior. A few epochs are enough: the field is near its end.
void add_learned_prior(const FitOptions& fit, std::vector<Stage>& stages) {
  constexpr int kPartOfEpochs = 2, kLeastEpochs = 2, kMostEpochs = 10, kAnswerEpochs = 3;
  constexpr double kAnswerRate = 0.05;  // larger steps would leave the answer and add grain
  Stage light = stages.back();
  light.first_epoch += light.epochs;
  light.epochs =
      std::clamp((fit.epochs + kPartOfEpochs - 1) / kPartOfEpochs, kLeastEpochs, kMostEpochs);
  light.first_rate = fit.learning_rate;
  light.is_light = true;
  stages.push_back(light);
  if (fit.prior == Prior::kLight) return;
  Stage answer = light;
  answer.first_epoch += light.epochs;
  answer.epochs = std::min(light.epochs, kAnswerEpochs);
  answer.first_rate = fit.learning_rate * kAnswerRate;
  answer.has_answer = true;
  stages.push_back(answer);
}

}  // namespace

int Schedule::vertex_epochs_of(int fine) const { return std::min(fine, epochs); }

int Schedule::coarse_epochs_of(int fine) const {
  constexpr double kCoarseEpochs = 160;
  const double part = std::clamp(static_cast<double>(fine) / epochs, 0.0, 1.0);
  return static_cast<int>(std::round(kCoarseEpochs * part));
}

bool begins_with_vertices(const FieldOptions& field, const FitOptions& fit) {
  if (field.kind != FieldKind::kVm || field.tree != TreeKind::kUniform ||
      fit.engine != Engine::kSlab)
    return false;
  const double side = field.leaf_size / field.vertex_spacing;
  const double left = side + 1 - field.rank;  // vertices along x and along y beyond the rank
  const double margin_side = (field.leaf_size << depth_of(field)) / field.margin_spacing;
  return side <= 2 * field.rank && left > 0 && left * left >= field.rank &&
         (!field.with_margin || margin_side <= 4 * kMarginRank);
}

bool can_have_learned_prior(const FieldOptions& field, const FitOptions& fit) {
  return field.kind == FieldKind::kGrid && field.tree == TreeKind::kUniform &&
         field.vertex_spacing == 1.0 && fit.engine == Engine::kSlab;
}

Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit, bool is_filtered) {
  Schedule schedule{fit.vertex_epochs > 0 ? 10 : 30, 0.05};
  if (field.kind == FieldKind::kGrid) schedule = {10, 0.035};
  const std::vector<int> bins = coarse_bins(field, fit);
  if (!bins.empty() && field.finest_spacing() >= bins.front()) schedule.epochs = 5;
  if (is_filtered && field.kind == FieldKind::kGrid) schedule.epochs *= 2;
  return schedule;
}

std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit) {
  const std::vector<int> bins = coarse_bins(field, fit);
  const bool has_vertices = fit.vertex_epochs > 0;
  const FieldKind first_kind = has_vertices ? FieldKind::kGrid : *field.kind;
  const double rate = fit.learning_rate * (has_vertices ? kVertexRate : 1.0);
  const double cost = has_vertices ? kVertexCost : 1.0;
  std::vector<Stage> stages;
  std::int64_t first_epoch = 0;
  double first_rate = rate;
  const auto add_before_last = [&](int bin, int epochs) {
    stages.push_back({first_kind, bin, first_epoch, epochs, first_rate, rate * kCoarseFinalRate,
                      cost * cost_of_bin(bin, field.finest_spacing())});
    first_epoch += epochs;
    first_rate = rate * kRefinedRate;
  };
  for (std::size_t left = bins.size(); left > 0; --left) {
    add_before_last(bins[left - 1],
                    static_cast<int>((fit.coarse_epochs - first_epoch) / static_cast<int>(left)));
  }
  if (has_vertices) {
    add_before_last(1, fit.vertex_epochs);
    first_rate = fit.learning_rate * kFactorisedRate;
  }
  stages.push_back(
      {field.kind, 1, first_epoch, fit.epochs, first_rate, fit.learning_rate * kFinalRate});
  if (fit.prior != Prior::kTv) add_learned_prior(fit, stages);
  return stages;
}

}  // namespace tomofield::fit
