#include "objective/terms.h"

#include <algorithm>
#include <cmath>

#include "objective/answer_pull.h"
#include "objective/boundary_consistency.h"
#include "objective/constants.h"
#include "objective/fourier_prior.h"
#include "objective/ray_data_term.h"
#include "objective/slab_data_term.h"
#include "objective/total_variation.h"

namespace tomofield::objective {
namespace {

// Returns the penalty of both variations, in density units. A pixel of the stage is the mean of
// bin² pixels on a path bin times as long, so a voxel of it has a noise smaller by bin².
kernels::VariationPenalty variation_penalty(const TermContext& c) {
  kernels::VariationPenalty penalty;
  penalty.epsilon = static_cast<float>(kGradientFloor);
  if (c.options.penalty == Penalty::kConcave && !c.is_light)
    penalty.concavity =
        static_cast<float>(concavity(kConcavity, c.full.noise_sigma) / (c.bin * c.bin));
  return penalty;
}

// Returns a factor on the weight of the density's variation in a stage. Total variation counts a
// slow change less where there is fine detail on top of it, because slopes add up as squares do. A
// coarse field has no fine detail, so the whole weight of the smooth penalty would flatten it more
// than the fit at full resolution wants, which brings back little of it in a few epochs
// (docs/results/convergence.md).
double factor_of_stage(const TermContext& c) {
  constexpr double kFactorOfHalving = 0.8;
  if (c.options.penalty == Penalty::kConcave) return 1.0;
  return std::pow(kFactorOfHalving, std::log2(c.bin));
}

// Returns the weight of the density's variation in a stage, in noise units. The stages of the prior
// have the smooth penalty with its usual weight in place of the one that was chosen, and the one
// before the answer has a part of that.
double variation_weight(const TermContext& c) {
  constexpr double kLightPart = 0.3;  // as in the training of the prior (tools/train_prior)
  const double weight = c.options.density_variation;
  if (c.is_light)
    return (c.answer.empty() ? kLightPart : 1.0) * weight * usual_variation(Penalty::kSmooth) /
           usual_variation(c.options.penalty);
  return factor_of_stage(c) * variation_gain(c.options, c.full) * weight;
}

// The views measure fine detail of a voxel with a precision of about their number over the variance
// of a ray. Of such detail the answer of the prior knows more than all of them.
double pull_weight(const TermContext& c, double noise) {
  constexpr double kAnswerOverViews = 4.0;
  const auto num_views = static_cast<double>(c.full.num_fitted_views());
  return kAnswerOverViews * num_views / (noise * noise);
}

// A jump at a face counts like total variation: density times area. Faces and the Fourier prior
// count pixels at full resolution. A pixel of the stage has bin² of them in a face and bin³ in a
// volume.
BoundaryOptions boundary_options(const TermContext& c, double noise) {
  return {.weight = c.options.boundary / (noise * c.bin * c.bin), .seed = c.options.seed};
}

FourierPriorOptions fourier_options(const TermContext& c, double noise) {
  FourierPriorOptions fourier;
  fourier.weight = c.options.fourier / (noise * c.bin * c.bin * c.bin);
  fourier.seed = c.options.seed;
  fourier.axes.reference = c.options.fourier_ring;
  return fourier;
}

}  // namespace

double variation_gain(const FitOptions& options, const measurement::Measurement& full) {
  if (options.penalty != Penalty::kConcave) return 1.0;
  return gain_of_little_noise(typical_noise(full.noise_sigma), full.contrast());
}

// The residuals are in units of the noise, with standard deviation σ. A prior that is the same for
// every series would have a constant weight in these units. Total variation has to suppress the
// noise: in units of the data its best weight grows with σ rather than with σ² (as in denoising:
// Rudin, Osher and Fatemi 1992), so in units of the noise it falls as 1 / σ. The σ of the stage's
// pixels serves every size.
std::vector<std::unique_ptr<Term>> make_terms(const TermContext& c) {
  const double noise = typical_noise(c.measured.noise_sigma);
  const double density = variation_weight(c) / noise;
  const double factors = c.has_factors ? c.options.factor_variation / noise : 0.0;
  const kernels::VariationPenalty penalty = variation_penalty(c);
  const bool has_rays = c.full.ray_geometry.has_value();
  std::vector<std::unique_ptr<Term>> terms;
  if (!has_rays) terms.push_back(std::make_unique<SlabDataTerm>(*c.measured.rays));
  terms.push_back(std::make_unique<DensityVariation>(density, penalty, c.options.seed));
  terms.push_back(std::make_unique<FactorVariation>(c.field, factors, penalty));
  terms.push_back(std::make_unique<BoundaryConsistency>(
      c.field, c.sampler.leaves_of_slabs({0, c.sampler.num_slabs()}), boundary_options(c, noise)));
  terms.push_back(std::make_unique<FourierPrior>(c.field, c.full.roi, fourier_options(c, noise),
                                                 c.processes, c.own_leaves));
  terms.push_back(std::make_unique<AnswerPull>(c.field, c.answer, pull_weight(c, noise)));
  if (has_rays)
    terms.push_back(std::make_unique<RayDataTerm>(*c.full.ray_geometry, *c.full.rays, c.field,
                                                  RayRegion{c.full.roi, c.support}, c.options));
  return terms;
}

double typical_noise(std::span<const double> sigma_of_view) {
  double precision = 0.0;
  for (const double sigma : sigma_of_view) precision += 1.0 / (sigma * sigma);
  return std::sqrt(static_cast<double>(sigma_of_view.size()) / precision);
}

double concavity(double in_voxel_noise, std::span<const double> sigma_of_view) {
  constexpr double kMinConcavity = 0.02;
  const double noise =
      typical_noise(sigma_of_view) / std::sqrt(static_cast<double>(sigma_of_view.size()));
  return std::max(in_voxel_noise * noise, kMinConcavity);
}

double gain_of_little_noise(double noise, double contrast) {
  constexpr double kLittle = 0.15;
  return std::max(1.0, kLittle * contrast / noise);
}

}  // namespace tomofield::objective
