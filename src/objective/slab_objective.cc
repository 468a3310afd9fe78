#include "objective/slab_objective.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "kernels/lanes.h"
#include "objective/terms.h"

namespace tomofield::objective {
namespace {

using kernels::kLanes;

constexpr int kSlabsTogether = projection::SlabProjector::kSlabsTogether;

projection::SlabSampler make_sampler(const SlabObjectiveContext& c) {
  return {c.field, c.projector.grid(), c.first_row, (c.num_rows + c.bin - 1) / c.bin, c.bin};
}

// Returns the slabs of the first rows of a band.
base::Range first_slabs(const projection::SlabSampler& sampler, int band, std::int64_t rows) {
  if (rows == 0) return {};
  const int first = sampler.band(band).begin;
  return {first, first + static_cast<int>(rows / kLanes)};
}

// Numbers the pairs of slabs of all bands and returns the number of each slab's pair.
std::vector<int> pair_of_each_slab(const projection::SlabSampler& sampler) {
  std::vector<int> pairs;
  int next = 0;
  for (int band = 0; band < sampler.num_bands(); ++band) {
    const base::Range slabs = sampler.band(band);
    for (int slab = slabs.begin; slab < slabs.end; ++slab)
      pairs.push_back(next + (slab - slabs.begin) / kSlabsTogether);
    next = pairs.back() + 1;
  }
  return pairs;
}

TermContext term_context(const SlabObjectiveContext& c, const projection::SlabSampler& sampler) {
  return {c.field,       sampler,      c.measured, c.full,      c.bin,      c.support,
          c.has_factors, c.own_leaves, c.options,  c.processes, c.is_light, c.answer};
}

}  // namespace

// Holds what the task of a band needs.
struct SlabObjective::Workspace {
  base::AlignedBuffer<float> samples, gradients;
  std::vector<std::unique_ptr<Term::Scratch>> of_terms;

  // Makes what is not there yet. The padding of samples starts as zeros and stays so.
  void prepare(const projection::SlabSampler& sampler, std::size_t slab_size,
               const std::vector<std::unique_ptr<Term>>& terms) {
    if (!samples.empty()) return;
    for (const auto& term : terms) of_terms.push_back(term->make_scratch(sampler));
    samples.reset(kSlabsTogether * slab_size);
    gradients.reset(kSlabsTogether * slab_size);
  }
};

// Holds what the slabs of a step share.
struct SlabObjective::Pass {
  const Step& step;
  const projection::ViewCrossings& crossings;
  float* gradient;                                           // by all parameters
  std::vector<std::unique_ptr<Term::LeafPass>> leaf_passes;  // of each term, or nothing
  Sums& sums;

  // Does part `index` of `count` of the readings of every term.
  void read(std::int64_t index, std::int64_t count) const {
    for (const auto& terms : leaf_passes) {
      if (!terms) continue;
      const std::int64_t first = terms->num_readings() * index / count;
      const std::int64_t end = terms->num_readings() * (index + 1) / count;
      base::parallel_for("read leaves", end - first,
                         [&](std::int64_t i) { terms->read(first + i); });
    }
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
      own_bands_(context.share.bands),
      slabs_for_next_(first_slabs(sampler_, own_bands_.end, context.share.rows_for_next)),
      slabs_by_previous_(first_slabs(sampler_, own_bands_.begin, context.share.rows_by_previous)),
      pair_of_slab_(pair_of_each_slab(sampler_)),
      terms_(std::move(terms)) {
  TOMOFIELD_CHECK(context.bin == 1 || context.share == context.share.without_help(),
                  "processes help each other at full resolution alone");
  for (int band = own_bands_.begin; band < own_bands_.end; ++band)
    std::ranges::copy(sampler_.leaves_of_band(band), std::back_inserter(own_leaves_));
}

SlabObjective::~SlabObjective() = default;

double SlabObjective::add_gradient(const Step& step, float* gradient,
                                   std::span<measurement::ViewSums> view_sums,
                                   const LeafDone& leaf_done) const {
  // Adds in the order of slabs and bands, so that threads and processes do not change the bits.
  const Sums sums = add(step, gradient, view_sums, leaf_done);
  double grad_bias = 0.0;
  for (const PairSums& pair : sums.pairs) {
    for (std::size_t v = 0; v < step.views.size(); ++v)
      view_sums[static_cast<std::size_t>(step.views[v])] += pair.views[v];
    grad_bias += pair.grad_bias;
  }
  for (const std::vector<TermValue>& band : sums.bands)
    for (const TermValue& term : band) grad_bias += term.grad_bias;
  return grad_bias + sums.field.grad_bias;
}

// Threads wait for each other only twice in a step, after the bands and after the leaves: on a
// machine with other work, each wait lasts until the slowest thread is done.
SlabObjective::Sums SlabObjective::add(const Step& step, float* gradient,
                                       std::span<measurement::ViewSums> view_sums,
                                       const LeafDone& leaf_done) const {
  Sums sums;
  sums.pairs.resize(static_cast<std::size_t>(pair_of_slab_.back() + 1));
  for (PairSums& pair : sums.pairs) {
    pair.views.resize(step.views.size());
    pair.terms.resize(terms_.size());
  }
  sums.bands.resize(static_cast<std::size_t>(sampler_.num_bands()),
                    std::vector<TermValue>(terms_.size()));
  const auto crossings = crossings_of(step.views);
  Pass pass{step, *crossings, gradient, {}, sums};
  for (const auto& term : terms_) pass.leaf_passes.push_back(term->leaf_pass(step, own_leaves_));

  const auto sending = add_slabs_of_next(pass);
  add_bands(pass);
  go_on_from_previous(pass);
  for (const auto& term : terms_) sums.field += term->add_field(step, gradient, view_sums);
  add_leaves(pass, leaf_done);
  allreduce(sums);
  return sums;
}

std::shared_ptr<const projection::ViewCrossings> SlabObjective::crossings_of(
    std::span<const int> views) const {
  auto& known = crossings_[{views.begin(), views.end()}];
  if (!known) known = std::make_shared<projection::ViewCrossings>(projector_.crossings(views));
  return known;
}

// Adds the slabs of the own bands, but for a first one that the process before has begun, and does
// the readings of the leaves beside them.
void SlabObjective::add_bands(const Pass& pass) const {
  const int num_begun = slabs_by_previous_.is_empty() ? 0 : 1;
  const std::int64_t num_bands = own_bands_.size();
  base::parallel_for("bands", num_bands, [&](std::int64_t i) {
    const int band = own_bands_.begin + static_cast<int>(i);
    if (i >= num_begun) add_slabs(pass, band, sampler_.band(band), *workspaces_.borrow());
    pass.read(i, num_bands);
  });
}

// Works on the first slabs of the next process's first band and starts to send what was found.
distributed::Communicator::Sending SlabObjective::add_slabs_of_next(const Pass& pass) const {
  std::vector<float> message;
  if (!slabs_for_next_.is_empty()) {
    const auto workspace = workspaces_.borrow();
    add_slabs(pass, own_bands_.end, slabs_for_next_, *workspace);
    for_each_handed_over(slabs_for_next_, *workspace, pass.gradient, [&](std::span<float> values) {
      message.insert(message.end(), values.begin(), values.end());
      std::ranges::fill(values, 0.0f);
    });
  }
  return processes_.start_sending(std::move(message), processes_.rank() + 1);
}

// Takes over what the process before found in the first slabs of the first band, and adds the
// others.
void SlabObjective::go_on_from_previous(const Pass& pass) const {
  if (slabs_by_previous_.is_empty()) return;
  const auto workspace = workspaces_.borrow();
  workspace->prepare(sampler_, projector_.grid().size(), terms_);
  std::size_t size = 0;
  for_each_handed_over(slabs_by_previous_, *workspace, pass.gradient,
                       [&](std::span<float> values) { size += values.size(); });
  std::vector<float> message(size);
  processes_.receive(std::span(message), processes_.rank() - 1);
  const float* next = message.data();
  for_each_handed_over(slabs_by_previous_, *workspace, pass.gradient, [&](std::span<float> values) {
    std::copy_n(next, values.size(), values.data());
    next += values.size();
  });
  const int band = own_bands_.begin;
  add_slabs(pass, band, {slabs_by_previous_.end, sampler_.band(band).end}, *workspace);
}

// Calls body for all that the work on a band's later slabs begins with: what the terms carry, and
// the gradient of the leaves of its first slabs.
void SlabObjective::for_each_handed_over(base::Range slabs, Workspace& workspace, float* gradient,
                                         const std::function<void(std::span<float>)>& body) const {
  for (const auto& scratch : workspace.of_terms)
    if (!scratch->carried().empty()) body(scratch->carried());
  for (const int leaf : sampler_.leaves_of_slabs(slabs))
    body({gradient + field_.offset(leaf), field_.offset(leaf + 1) - field_.offset(leaf)});
}

// Adds some slabs of a band, pair by pair. If they are not its first ones, the workspace and the
// gradient hold what came before.
void SlabObjective::add_slabs(const Pass& pass, int band, base::Range slabs,
                              Workspace& workspace) const {
  workspace.prepare(sampler_, projector_.grid().size(), terms_);
  for (int slab = slabs.begin; slab < slabs.end; slab += kSlabsTogether) {
    const auto pair = static_cast<std::size_t>(pair_of_slab_[static_cast<std::size_t>(slab)]);
    add_batch(pass,
              {.sampler = sampler_,
               .projector = projector_,
               .crossings = pass.crossings,
               .slabs = {slab, std::min(slab + kSlabsTogether, slabs.end)},
               .begins_band = slab == sampler_.band(band).begin,
               .all_samples = workspace.samples.data(),
               .all_gradients = workspace.gradients.data()},
              workspace, pass.sums.pairs[pair]);
  }
}

void SlabObjective::add_batch(const Pass& pass, const SlabBatch& batch, Workspace& workspace,
                              PairSums& sums) const {
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
    sums.terms[t].value =
        terms_[t]->add_slabs(pass.step, batch, workspace.of_terms[t].get(), sums.views);

  const std::vector<int> leaves = sampler_.leaves_of_slabs(batch.slabs);
  std::vector<double> grad_bias(leaves.size() * static_cast<std::size_t>(batch.slabs.size()));
  base::parallel_for("decode, adjoint", std::ssize(leaves), [&](std::int64_t i) {
    for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
      const auto of_slab = static_cast<std::size_t>(slab - batch.slabs.begin) * leaves.size();
      grad_bias[of_slab + static_cast<std::size_t>(i)] =
          sampler_.decode_adjoint_of_leaf(leaves[static_cast<std::size_t>(i)], slab,
                                          batch.samples(slab), batch.gradient(slab), pass.gradient);
    }
  });
  for (const double of_leaf : grad_bias) sums.grad_bias += of_leaf;
}

// Adds the terms that are computed leaf by leaf, which completes the gradient of a leaf.
void SlabObjective::add_leaves(const Pass& pass, const LeafDone& leaf_done) const {
  std::vector<TermValue> found(own_leaves_.size() * terms_.size());
  base::parallel_for("leaves", std::ssize(own_leaves_), [&](std::int64_t i) {
    const auto index = static_cast<std::size_t>(i);
    for (std::size_t t = 0; t < terms_.size(); ++t)
      if (pass.leaf_passes[t])
        found[index * terms_.size() + t] = pass.leaf_passes[t]->add_leaf(index, pass.gradient);
    leaf_done(own_leaves_[index]);
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    const int leaf = own_leaves_[i / terms_.size()];
    const auto band = static_cast<std::size_t>(field_.tree().band_of_leaf(leaf));
    pass.sums.bands[band][i % terms_.size()] += found[i];
  }
}

// Gives every process the sums of all slabs and leaves, in one message.
void SlabObjective::allreduce(Sums& sums) const {
  if (processes_.size() == 1) return;
  std::vector<double> numbers;
  const auto for_each_number = [&](const auto& body) {
    for (PairSums& pair : sums.pairs) {
      for (measurement::ViewSums& s : pair.views)
        for (double* number : {&s.n, &s.p, &s.b, &s.pp, &s.pb, &s.bb, &s.limited_squares})
          body(*number);
      body(pair.grad_bias);
    }
    for (std::vector<TermValue>& band : sums.bands)
      for (TermValue& term : band) body(term.grad_bias);
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

std::vector<measurement::PredictedView> SlabObjective::predict(
    std::span<const int> views, std::span<const measurement::ViewModel> models) const {
  return measurement::predicted_views(sampler_, projector_, *measured_.rays, views, models,
                                      processes_);
}

}  // namespace tomofield::objective
