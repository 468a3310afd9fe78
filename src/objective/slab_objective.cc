#include "objective/slab_objective.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/parallel.h"
#include "objective/terms.h"

namespace tomofield::objective {
namespace {

constexpr int kSlabsTogether = projection::SlabProjector::kSlabsTogether;

projection::SlabSampler make_sampler(const SlabObjectiveContext& c) {
  return {c.field, c.projector.grid(), c.first_row, (c.num_rows + c.bin - 1) / c.bin, c.bin};
}

TermContext term_context(const SlabObjectiveContext& c, const projection::SlabSampler& sampler) {
  return {c.field,   sampler,       c.measured,   c.full,    c.bin,
          c.support, c.has_factors, c.own_leaves, c.options, c.processes};
}

}  // namespace

// Holds what a thread needs for a batch; kept between calls.
struct SlabObjective::Workspace {
  base::AlignedBuffer<float> samples, gradients;

  void fit(std::size_t slab_size) {
    // Padding has to start as zeros and stays so: a new layout needs new buffers.
    if (samples.size() == kSlabsTogether * slab_size) return;
    samples.reset(kSlabsTogether * slab_size);
    gradients.reset(kSlabsTogether * slab_size);
  }
};

SlabObjective::SlabObjective(const SlabObjectiveContext& context) : SlabObjective(context, {}) {
  terms_ = make_terms(term_context(context, sampler_));
}

SlabObjective::SlabObjective(const SlabObjectiveContext& context,
                             std::vector<std::unique_ptr<Term>> terms)
    : projector_(context.projector),
      measured_(context.measured),
      sampler_(make_sampler(context)),
      processes_(context.processes),
      own_bands_(context.own_bands),
      terms_(std::move(terms)) {
  for (int band = own_bands_.begin; band < own_bands_.end; ++band)
    std::ranges::copy(sampler_.leaves_of_band(band), std::back_inserter(own_leaves_));
}

double SlabObjective::add_gradient(const Step& step, float* gradient,
                                   std::span<measurement::ViewSums> view_sums) const {
  std::vector<BandSums> bands(static_cast<std::size_t>(sampler_.num_bands()));
  for (BandSums& band : bands) {
    band.views.resize(step.views.size());
    band.terms.resize(terms_.size());
  }
  base::parallel_for("bands", own_bands_.size(), [&](std::int64_t i) {
    const int band = own_bands_.begin + static_cast<int>(i);
    bands[static_cast<std::size_t>(band)] = add_band(step, band, gradient);
  });
  allreduce(bands);
  // Adds in the order of the bands, so that threads and processes do not change the bits.
  double slab_grad_bias = 0.0;
  std::vector<double> term_grad_bias(terms_.size());
  for (const BandSums& band : bands) {
    for (std::size_t v = 0; v < step.views.size(); ++v)
      view_sums[static_cast<std::size_t>(step.views[v])] += band.views[v];
    slab_grad_bias += band.slab_grad_bias;
    for (std::size_t t = 0; t < terms_.size(); ++t) term_grad_bias[t] += band.terms[t].grad_bias;
  }
  double grad_bias = slab_grad_bias;
  for (const double of_term : term_grad_bias) grad_bias += of_term;
  for (const auto& term : terms_) grad_bias += term->add_field(step, gradient, view_sums).grad_bias;
  return grad_bias;
}

SlabObjective::BandSums SlabObjective::add_band(const Step& step, int band, float* gradient) const {
  thread_local Workspace w;
  w.fit(projector_.grid().size());
  BandSums sums;
  sums.views.resize(step.views.size());
  sums.terms.resize(terms_.size());
  const auto slabs = sampler_.band(band);
  for (int slab = slabs.begin; slab < slabs.end; slab += kSlabsTogether) {
    add_batch(step,
              {.sampler = sampler_,
               .projector = projector_,
               .slabs = {slab, std::min(slab + kSlabsTogether, slabs.end)},
               .begins_band = slab == slabs.begin,
               .all_samples = w.samples.data(),
               .all_gradients = w.gradients.data()},
              gradient, sums);
  }
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    const TermValue of_band = terms_[t]->add_band(step, band, gradient);
    sums.terms[t].value += of_band.value;
    sums.terms[t].grad_bias += of_band.grad_bias;
  }
  return sums;
}

void SlabObjective::add_batch(const Step& step, const SlabBatch& batch, float* gradient,
                              BandSums& sums) const {
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab)
    sampler_.decode(slab, batch.samples(slab));
  if (terms_.empty() || !terms_.front()->replaces_gradient())
    std::fill_n(batch.all_gradients,
                static_cast<std::size_t>(batch.size()) * projector_.grid().size(), 0.0f);
  for (std::size_t t = 0; t < terms_.size(); ++t)
    sums.terms[t].value += terms_[t]->add_slabs(step, batch, sums.views);
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
    sums.slab_grad_bias +=
        sampler_.decode_adjoint(slab, batch.samples(slab), batch.gradient(slab), gradient);
  }
}

// Gives every process the sums of all bands, in one message.
void SlabObjective::allreduce(std::vector<BandSums>& bands) const {
  if (processes_.size() == 1) return;
  std::vector<double> numbers;
  const auto for_each_number = [&](const auto& body) {
    for (BandSums& band : bands) {
      for (measurement::ViewSums& s : band.views)
        for (double* number : {&s.n, &s.p, &s.b, &s.pp, &s.pb, &s.bb}) body(*number);
      body(band.slab_grad_bias);
      for (TermValue& term : band.terms) body(term.grad_bias);
    }
  };
  for_each_number([&](double& number) { numbers.push_back(number); });
  processes_.allreduce_sum(std::span(numbers));
  auto next = numbers.begin();
  for_each_number([&](double& number) { number = *next++; });
}

measurement::ViewErrors SlabObjective::held_out_error(std::span<const double> noise_weight,
                                                      bool fit_view_scale) const {
  return measurement::held_out_error(sampler_, projector_, *measured_.rays, measured_.held_out,
                                     noise_weight, fit_view_scale, processes_);
}

measurement::PredictedView SlabObjective::predict(int view,
                                                  const measurement::ViewModel& model) const {
  return measurement::predicted_view(sampler_, projector_, *measured_.rays, view, model,
                                     processes_);
}

}  // namespace tomofield::objective
