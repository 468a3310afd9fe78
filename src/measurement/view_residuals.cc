#include "measurement/view_residuals.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include "kernels/lanes.h"

namespace tomofield::measurement {

using kernels::kLanes;

ViewSums& ViewSums::operator+=(const ViewSums& other) {
  n += other.n;
  p += other.p;
  b += other.b;
  pp += other.pp;
  pb += other.pb;
  bb += other.bb;
  limited_squares += other.limited_squares;
  return *this;
}

void allreduce_sum(const distributed::Communicator& processes, std::span<ViewSums> sums) {
  processes.allreduce_sum(sums, &ViewSums::n, &ViewSums::p, &ViewSums::b, &ViewSums::pp,
                          &ViewSums::pb, &ViewSums::bb, &ViewSums::limited_squares);
}

double ViewSums::squared_residual(const ViewModel& m) const {
  return m.scale * m.scale * pp + bb + n * m.offset * m.offset + 2 * m.scale * m.offset * p -
         2 * m.scale * pb - 2 * m.offset * b;
}

ViewSums data_term(const ViewModel& model, double multiplicity, const float* measured,
                   const std::uint16_t* mask, std::int64_t width, float* rays) {
  const float scale = static_cast<float>(model.scale);
  const float offset = static_cast<float>(model.offset);
  const float limit = static_cast<float>(model.largest_residual);
  const float slope = static_cast<float>(multiplicity * model.weight * model.scale);
  ViewSums sums;
  for (std::int64_t x = 0; x < width; ++x) {
    float sp = 0, sb = 0, spp = 0, spb = 0, sbb = 0, squares = 0;
    const unsigned bits = mask[x];
    for (int l = 0; l < kLanes; ++l) {
      const std::ptrdiff_t at = x * kLanes + l;
      const float counts = static_cast<float>(bits >> l & 1u);
      const float p = counts * rays[at];
      const float b = counts * measured[at];
      const float residual = std::min(std::max(scale * p + counts * offset - b, -limit), limit);
      rays[at] = slope * residual;
      sp += p;
      sb += b;
      spp += p * p;
      spb += p * b;
      sbb += b * b;
      squares += residual * residual;
    }
    sums += {static_cast<double>(std::popcount(bits)),
             static_cast<double>(sp),
             static_cast<double>(sb),
             static_cast<double>(spp),
             static_cast<double>(spb),
             static_cast<double>(sbb),
             static_cast<double>(squares)};
  }
  return sums;
}

double ray_data_term(const ViewModel& model, double multiplicity, double measured, double predicted,
                     ViewSums& sums) {
  const double residual = std::clamp(model.scale * predicted + model.offset - measured,
                                     -model.largest_residual, model.largest_residual);
  sums += {1.0,
           predicted,
           measured,
           predicted * predicted,
           predicted * measured,
           measured * measured,
           residual * residual};
  return multiplicity * model.weight * model.scale * residual;
}

// Keeps the equations of a view without rays solvable: it gets scale 1, offset 0.
constexpr double kNoRays = 1e-9;

void fit_nuisances(const NuisancePrior& prior, const std::vector<ViewSums>& sums,
                   std::vector<ViewModel>& views) {
  double log_scales = 0.0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const ViewSums& s = sums[v];
    const double w = views[v].weight;
    const double offsets = prior.has_free_offsets ? 0.0 : prior.shrinkage;
    // Rounding errors of a prediction that is constant must not become a scale.
    const double squares =
        prior.has_free_offsets && s.n > 0 ? std::max(s.pp - s.p * s.p / s.n, 1e-6 * s.pp) : s.pp;
    const double prior_a = prior.shrinkage * w * squares + kNoRays;
    const double prior_o = offsets * w * s.n + kNoRays;
    const double aa = w * s.pp + prior_a, ao = w * s.p, oo = w * s.n + prior_o;
    const double rhs_a = w * s.pb + prior_a, rhs_o = w * s.b;
    const double determinant = aa * oo - ao * ao;
    views[v].scale = std::clamp((rhs_a * oo - rhs_o * ao) / determinant, 0.2, 5.0);
    views[v].offset = (rhs_o - ao * views[v].scale) / oo;
    log_scales += std::log(views[v].scale);
  }
  const double common = std::exp(log_scales / static_cast<double>(views.size()));
  for (ViewModel& view : views) view.scale /= common;
  if (!prior.has_free_offsets) return;
  for (std::size_t v = 0; v < views.size(); ++v) views[v].offset = mean_offset(sums[v], views[v]);
}

double mean_offset(const ViewSums& sums, const ViewModel& model) {
  return sums.n > 0 ? (sums.b - model.scale * sums.p) / sums.n : 0.0;
}

namespace {

// Returns the least-squares model measured ≈ scale · predicted + offset.
ViewModel fitted_model(const ViewSums& s, double weight) {
  const double spread = s.n * s.pp - s.p * s.p;
  const bool is_flat = !(spread > 1e-9 * s.n * s.pp);
  const double scale = is_flat ? 1.0 : (s.n * s.pb - s.p * s.b) / spread;
  ViewModel model{scale, 0.0, weight};
  model.offset = mean_offset(s, model);
  return model;
}

}  // namespace

ViewErrors view_errors(std::vector<int> views, const SlabSums& sums,
                       std::span<const double> noise_weight, bool fit_view_scale) {
  ViewErrors error;
  error.views = std::move(views);
  double squares = 0, rays = 0;
  for (std::size_t v = 0; v < error.views.size(); ++v) {
    const double weight = noise_weight[static_cast<std::size_t>(error.views[v])];
    ViewSums view;
    for (const auto& slab : sums) view += slab[v];
    error.models.push_back(fit_view_scale ? fitted_model(view, weight)
                                          : ViewModel{1.0, 0.0, weight});
    const double view_squares = weight * view.squared_residual(error.models.back());
    error.view_error.push_back(view.n > 0 ? view_squares / view.n : 0.0);
    squares += view_squares;
    rays += view.n;
  }
  error.total = rays > 0 ? squares / rays : 0.0;
  return error;
}

}  // namespace tomofield::measurement
