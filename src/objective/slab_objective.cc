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

// Holds what the task of a band needs.
struct SlabObjective::Workspace {
  base::AlignedBuffer<float> samples, gradients;
  std::vector<std::unique_ptr<Term::Scratch>> of_terms;

  void fit(std::size_t size, const std::vector<std::unique_ptr<Term>>& terms) {
    while (of_terms.size() < terms.size())
      of_terms.push_back(terms[of_terms.size()]->make_scratch());
    // Padding has to start as zeros and stays so: a new layout needs new buffers.
    if (samples.size() == size) return;
    samples.reset(size);
    gradients.reset(size);
  }
};

SlabObjective::SlabObjective(const SlabObjectiveContext& context) : SlabObjective(context, {}) {
  terms_ = make_terms(term_context(context, sampler_));
}

SlabObjective::SlabObjective(const SlabObjectiveContext& context,
                             std::vector<std::unique_ptr<Term>> terms)
    : field_(context.field),
      projector_(context.projector),
      measured_(context.measured),
      sampler_(make_sampler(context)),
      processes_(context.processes),
      own_bands_(context.own_bands),
      terms_(std::move(terms)) {
  for (int band = own_bands_.begin; band < own_bands_.end; ++band)
    std::ranges::copy(sampler_.leaves_of_band(band), std::back_inserter(own_leaves_));
}

SlabObjective::~SlabObjective() = default;

double SlabObjective::add_gradient(const Step& step, float* gradient,
                                   std::span<measurement::ViewSums> view_sums) const {
  // Adds in the order of the bands, so that threads and processes do not change the bits.
  double slab_grad_bias = 0.0;
  std::vector<double> term_grad_bias(terms_.size());
  for (const BandSums& band : add_bands(step, gradient)) {
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

std::vector<SlabObjective::BandSums> SlabObjective::add_bands(const Step& step,
                                                              float* gradient) const {
  std::vector<BandSums> bands(static_cast<std::size_t>(sampler_.num_bands()));
  for (BandSums& band : bands) {
    band.views.resize(step.views.size());
    band.terms.resize(terms_.size());
  }
  const projection::ViewCrossings crossings = projector_.crossings(step.views);
  base::parallel_for("bands", own_bands_.size(), [&](std::int64_t i) {
    const int band = own_bands_.begin + static_cast<int>(i);
    add_slabs(step, band, crossings, gradient, bands[static_cast<std::size_t>(band)]);
  });
  add_leaves(step, gradient, bands);
  allreduce(bands);
  return bands;
}

void SlabObjective::add_slabs(const Step& step, int band,
                              const projection::ViewCrossings& crossings, float* gradient,
                              BandSums& sums) const {
  const auto workspace = workspaces_.borrow();
  workspace->fit(kSlabsTogether * projector_.grid().size(), terms_);
  const base::Range slabs = sampler_.band(band);
  for (int slab = slabs.begin; slab < slabs.end; slab += kSlabsTogether) {
    add_batch(step,
              {.sampler = sampler_,
               .projector = projector_,
               .crossings = crossings,
               .slabs = {slab, std::min(slab + kSlabsTogether, slabs.end)},
               .begins_band = slab == slabs.begin,
               .all_samples = workspace->samples.data(),
               .all_gradients = workspace->gradients.data()},
              *workspace, gradient, sums);
  }
}

void SlabObjective::add_batch(const Step& step, const SlabBatch& batch, Workspace& workspace,
                              float* gradient, BandSums& sums) const {
  std::vector<std::pair<int, int>> pieces;  // slab, piece
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab)
    for (int piece = 0; piece < sampler_.num_pieces(slab); ++piece)
      pieces.emplace_back(slab, piece);
  base::parallel_for("decode", std::ssize(pieces), [&](std::int64_t i) {
    const auto [slab, piece] = pieces[static_cast<std::size_t>(i)];
    sampler_.decode_piece(slab, piece, batch.samples(slab));
  });
  if (terms_.empty() || !terms_.front()->replaces_gradient())
    std::fill_n(batch.all_gradients,
                static_cast<std::size_t>(batch.slabs.size()) * projector_.grid().size(), 0.0f);
  for (std::size_t t = 0; t < terms_.size(); ++t)
    sums.terms[t].value +=
        terms_[t]->add_slabs(step, batch, workspace.of_terms[t].get(), sums.views);

  const std::vector<int> leaves = sampler_.leaves_of_slabs(batch.slabs);
  std::vector<double> grad_bias(leaves.size() * static_cast<std::size_t>(batch.slabs.size()));
  base::parallel_for("decode, adjoint", std::ssize(leaves), [&](std::int64_t i) {
    for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
      const auto of_slab = static_cast<std::size_t>(slab - batch.slabs.begin) * leaves.size();
      grad_bias[of_slab + static_cast<std::size_t>(i)] =
          sampler_.decode_adjoint_of_leaf(leaves[static_cast<std::size_t>(i)], slab,
                                          batch.samples(slab), batch.gradient(slab), gradient);
    }
  });
  for (const double of_leaf : grad_bias) sums.slab_grad_bias += of_leaf;
}

// Adds the terms that are computed leaf by leaf to the gradient and to the sums of the bands.
void SlabObjective::add_leaves(const Step& step, float* gradient,
                               std::vector<BandSums>& bands) const {
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    std::vector<TermValue> of_leaf(own_leaves_.size());
    terms_[t]->add_leaves(step, own_leaves_, gradient, of_leaf);
    for (std::size_t i = 0; i < of_leaf.size(); ++i) {
      const auto band = static_cast<std::size_t>(field_.tree().band_of_leaf(own_leaves_[i]));
      bands[band].terms[t] += of_leaf[i];
    }
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
