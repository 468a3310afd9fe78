#include "objective/fourier_prior.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/random.h"
#include "base/threads/parallel.h"

namespace tomofield::objective {
namespace {

// Random streams from here on place the samples.
constexpr std::uint64_t kSampleStream = std::uint64_t{2} << 48;

// Holds the range of the indices of ascending positions that lie in [low, high).
struct Range {
  std::size_t begin, end;
  Range(const std::vector<double>& positions, double low, double high) {
    const auto index = [&](double limit) {
      return static_cast<std::size_t>(std::lower_bound(positions.begin(), positions.end(), limit) -
                                      positions.begin());
    };
    begin = index(low);
    end = index(high);
  }
};

// Returns first + i · spacing for 0 <= i < count.
std::vector<double> positions(double first, double spacing, int count) {
  std::vector<double> at;
  for (int i = 0; i < count; ++i) at.push_back(first + i * spacing);
  return at;
}

}  // namespace

FourierPrior::FourierPrior(const field::Field& field, const Rectangle& roi,
                           const FourierPriorOptions& options)
    : FourierPrior(field, roi, options, distributed::Communicator::alone(),
                   {0, field.tree().num_leaves()}) {}

FourierPrior::FourierPrior(const field::Field& field, const Rectangle& roi,
                           const FourierPriorOptions& options,
                           const distributed::Communicator& processes, base::Range own)
    : field_(field), roi_(roi), options_(options), processes_(processes), own_(own) {
  const double width = static_cast<double>(roi.width()), height = static_cast<double>(roi.height());
  spacing_ = std::max(1.0, std::max(width, height) / options.max_samples);
  shape_ = {options.slices, static_cast<int>(height / spacing_),
            static_cast<int>(width / spacing_)};
  for (int leaf = 0; leaf < field.tree().num_leaves(); ++leaf) {
    const field::Square& s = field.tree().leaf(leaf).square;
    if (s.x0 <= roi.x1 && s.x1() >= roi.x0 && s.y0 <= roi.y1 && s.y1() >= roi.y0)
      leaves_.push_back(leaf);
  }
}

// Holds the samples in one leaf: their positions in the field and in the stack of slices.
struct FourierPrior::LeafSamples {
  std::vector<double> x, y, z;
  std::vector<std::size_t> index;
  std::vector<float> densities;

  field::Points points() const { return {x, y, z}; }
  void add(double at_x, double at_y, double at_z, std::size_t sample) {
    x.push_back(at_x);
    y.push_back(at_y);
    z.push_back(at_z);
    index.push_back(sample);
  }
};

// Draws the samples of a step: a grid with a random origin at stratified heights. Over the steps
// every point of the region counts, and aliases of the grid average out.
std::vector<FourierPrior::LeafSamples> FourierPrior::leaf_samples(std::int64_t step) const {
  base::Random random(options_.seed, kSampleStream + static_cast<std::uint64_t>(step));
  const auto origin = [&](std::int64_t low, std::int64_t length, int count) {
    return static_cast<double>(low) +
           random.uniform() * (static_cast<double>(length) - (count - 1) * spacing_);
  };
  const auto xs = positions(origin(roi_.x0, roi_.width(), shape_.nx), spacing_, shape_.nx);
  const auto ys = positions(origin(roi_.y0, roi_.height(), shape_.ny), spacing_, shape_.ny);
  std::vector<double> zs;
  for (int s = 0; s < shape_.slices; ++s)
    zs.push_back((s + random.uniform()) * field_.thickness() / shape_.slices);

  std::vector<LeafSamples> all(leaves_.size());
  for (std::size_t l = 0; l < leaves_.size(); ++l) {
    const field::Quadtree::Bounds bounds =
        field_.tree().bounds(field_.tree().leaf(leaves_[l]).square);
    const Range x(xs, bounds.x0, bounds.x1), y(ys, bounds.y0, bounds.y1);
    for (std::size_t s = 0; s < zs.size(); ++s) {
      for (std::size_t j = y.begin; j < y.end; ++j) {
        for (std::size_t i = x.begin; i < x.end; ++i)
          all[l].add(xs[i], ys[j], zs[s], (s * ys.size() + j) * xs.size() + i);
      }
    }
  }
  return all;
}

TermValue FourierPrior::add_gradient(std::int64_t step, float* gradient) const {
  if (options_.weight <= 0) return {};
  std::vector<LeafSamples> leaves = leaf_samples(step);
  std::vector<float> samples(shape_.size()), grad_samples(shape_.size(), 0.0f);
  base::parallel_for("fourier samples", std::ssize(leaves), [&](std::int64_t l) {
    LeafSamples& own = leaves[static_cast<std::size_t>(l)];
    const int leaf = leaves_[static_cast<std::size_t>(l)];
    if (!own_.contains(leaf)) return;
    own.densities.resize(own.x.size());
    field_.point_densities(leaf, own.points(), own.densities);
    for (std::size_t n = 0; n < own.index.size(); ++n) samples[own.index[n]] = own.densities[n];
  });
  processes_.allreduce_sum(std::span(samples));
  const double volume =
      static_cast<double>(roi_.width()) * static_cast<double>(roi_.height()) * field_.thickness();
  TermValue result;
  result.value =
      axis_penalty(shape_, samples, options_.axes, options_.weight * volume, grad_samples);
  std::vector<double> grad_bias(leaves.size());
  base::parallel_for("fourier gradient", std::ssize(leaves), [&](std::int64_t l) {
    const LeafSamples& own = leaves[static_cast<std::size_t>(l)];
    const int leaf = leaves_[static_cast<std::size_t>(l)];
    if (!own_.contains(leaf)) return;
    std::vector<float> grad;
    for (const std::size_t at : own.index) grad.push_back(grad_samples[at]);
    grad_bias[static_cast<std::size_t>(l)] = field_.point_gradient(
        leaf, own.points(), own.densities, grad, gradient + field_.offset(leaf));
  });
  processes_.allreduce_sum(std::span(grad_bias));
  for (const double g : grad_bias) result.grad_bias += g;
  return result;
}

}  // namespace tomofield::objective
