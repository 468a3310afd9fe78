#include "objective/ray_data_term.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random.h"

namespace tomofield::objective {
namespace {

using geometry::Extent2;
using geometry::RayBundle;
using projection::Ray;

// Random streams from here on draw the batches of an epoch and the samples of a step.
constexpr std::uint64_t kBatchStream = std::uint64_t{1} << 44;
constexpr std::uint64_t kSampleStream = std::uint64_t{2} << 40;

// The number of rays that are traced and kept at once. Each has some 100 samples.
constexpr std::size_t kRaysAtOnce = std::size_t{1} << 17;

double smallest_leaf(const field::Quadtree& tree) {
  double smallest = std::numeric_limits<double>::infinity();
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    smallest = std::min(smallest, static_cast<double>(tree.leaf(leaf).square.size));
  return smallest;
}

// Returns one sample a pixel along the diagonal of the smallest leaf, unless the options say more.
int samples_per_diagonal(const FitOptions& options, const field::Quadtree& tree, double thickness) {
  if (options.ray_samples > 0) return options.ray_samples;
  const double size = smallest_leaf(tree);
  return static_cast<int>(std::ceil(std::hypot(size, size, thickness)));
}

Extent2 extent_of(const Rectangle& roi) {
  return {static_cast<double>(roi.x0), static_cast<double>(roi.y0), static_cast<double>(roi.x1),
          static_cast<double>(roi.y1)};
}

// Estimates the bytes of what is kept of traced rays.
class TraceBytes {
 public:
  TraceBytes(const field::Quadtree& tree, double thickness, const RayRegion& region,
             const FitOptions& options)
      : region_(region),
        thickness_(thickness),
        leaf_size_(smallest_leaf(tree)),
        samples_a_pixel_(samples_per_diagonal(options, tree, thickness) /
                         std::hypot(leaf_size_, leaf_size_, thickness)) {}

  // Returns the bytes of the ray through a place of a view; 0 if it misses the region.
  double of_ray(const RayBundle& view, double u, double v) const {
    constexpr double kBytesPerPiece = 128, kBytesPerSample = 4, kPadding = 16;
    const RayBundle::Line line = view.line(u, v);
    if (clip(line, extent_of(region_.roi), {0.0, thickness_}).empty()) return 0.0;
    const geometry::HeightRange within = clip(line, region_.support, {0.0, thickness_});
    const double height = within.high - within.low;
    const double pieces =
        1 + height * (std::abs(line.x_per_z) + std::abs(line.y_per_z)) / leaf_size_;
    const double samples = height * view.length_per_z * samples_a_pixel_ + kPadding * pieces;
    return pieces * kBytesPerPiece + samples * kBytesPerSample;
  }

 private:
  const RayRegion& region_;
  double thickness_, leaf_size_, samples_a_pixel_;
};

std::uint32_t draw_of(std::uint64_t seed, std::uint64_t stream) {
  return static_cast<std::uint32_t>(base::Random(seed, stream).bits() >> 32);
}

}  // namespace

RayDataTerm::RayDataTerm(const geometry::RayGeometry& geometry,
                         const measurement::SlabViews& measured, const field::Field& field,
                         const RayRegion& region, const FitOptions& options)
    : measured_(measured),
      roi_(extent_of(region.roi)),
      thickness_(field.thickness()),
      roots_(field.tree().roots()),
      seed_(options.seed),
      steps_per_epoch_(options.subsets),
      projector_(geometry, field, region.support,
                 samples_per_diagonal(options, field.tree(), field.thickness())) {
  for (int view = 0; view < geometry.num_views(); ++view) bundles_.push_back(geometry.rays(view));
}

std::size_t RayDataTerm::working_memory(const geometry::RayGeometry& geometry,
                                        const field::Quadtree& tree, const RayRegion& region,
                                        const FitOptions& options,
                                        const measurement::SlabViews::Shape& shape) {
  constexpr double kBytesPerRay = 40;
  constexpr int kAcross = 32;  // rays along each side of a view that stand for the others
  constexpr double kPart = 1.0 / kAcross;
  const TraceBytes trace(tree, geometry.aligned.thickness, region, options);
  const auto width = static_cast<double>(shape.width),
             num_rows = static_cast<double>(shape.num_rows);
  double num_met = 0, bytes = 0;
  for (int view = 0; view < geometry.num_views(); ++view) {
    const RayBundle rays = geometry.rays(view);
    for (int i = 0; i < kAcross * kAcross; ++i) {
      const double of_ray = trace.of_ray(rays, (i % kAcross + 0.5) * kPart * width,
                                         (i / kAcross + 0.5) * kPart * num_rows);
      num_met += of_ray > 0 ? 1 : 0;
      bytes += of_ray;
    }
  }
  if (num_met == 0) return 0;
  const double num_rays = num_met * kPart * kPart * width * num_rows / options.subsets;
  const double at_once = std::min(num_rays, static_cast<double>(kRaysAtOnce));
  return static_cast<std::size_t>(num_rays * kBytesPerRay + at_once * bytes / num_met);
}

std::vector<Ray> RayDataTerm::batch(std::int64_t step) const {
  const auto& shape = measured_.shape();
  const std::int64_t epoch = step / steps_per_epoch_, turn = step % steps_per_epoch_;
  const std::int64_t num_pixels = shape.width * shape.num_rows;
  const std::uint32_t draw = draw_of(seed_, kBatchStream + static_cast<std::uint64_t>(epoch));
  std::vector<std::vector<Ray>> by_band(static_cast<std::size_t>(roots_.rows));
  for (std::size_t v = 0; v < bundles_.size(); ++v) {
    const std::uint32_t key = kernels::mix_bits(draw ^ static_cast<std::uint32_t>(v));
    for (std::int64_t first = 0; first < num_pixels; first += steps_per_epoch_) {
      const auto chosen =
          static_cast<std::int64_t>(kernels::mix_bits(key ^ static_cast<std::uint32_t>(first)) %
                                    static_cast<std::uint32_t>(steps_per_epoch_));
      const std::int64_t pixel = first + (chosen + turn) % steps_per_epoch_;
      if (pixel >= num_pixels) continue;
      const std::int64_t x = pixel % shape.width, y = pixel / shape.width;
      if (!measured_.counts(static_cast<int>(v), x, y)) continue;
      const RayBundle::Line line =
          bundles_[v].line(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      if (clip(line, roi_, {0.0, thickness_}).empty()) continue;
      const double middle = line.y0 + line.y_per_z * thickness_ / 2;
      const double band = std::floor((middle - static_cast<double>(roots_.y0)) /
                                     static_cast<double>(roots_.cell_size));
      by_band[static_cast<std::size_t>(std::clamp(band, 0.0, roots_.rows - 1.0))].push_back(
          {static_cast<std::int32_t>(v), static_cast<std::int32_t>(x),
           static_cast<std::int32_t>(y)});
    }
  }
  std::vector<Ray> rays;
  for (const auto& band : by_band) rays.insert(rays.end(), band.begin(), band.end());
  return rays;
}

// Adds the gradient of the step's rays. It is scaled up to all rays.
TermValue RayDataTerm::add_field(const Step& step, float* gradient,
                                 std::span<measurement::ViewSums> view_sums) const {
  const std::vector<Ray> rays = batch(step.number);
  const std::uint32_t draw =
      draw_of(seed_, kSampleStream + static_cast<std::uint64_t>(step.number));
  TermValue result;
  std::vector<measurement::ViewSums> sums(bundles_.size());
  projection::RayTrace trace;
  for (std::size_t first = 0; first < rays.size(); first += kRaysAtOnce) {
    const auto part = std::span(rays).subspan(first, std::min(kRaysAtOnce, rays.size() - first));
    std::vector<float> values = projector_.forward(part, draw, trace);
    for (std::size_t i = 0; i < part.size(); ++i) {
      const Ray& ray = part[i];
      const auto view = static_cast<std::size_t>(ray.view);
      values[i] = static_cast<float>(
          measurement::ray_data_term(step.models[view], steps_per_epoch_,
                                     static_cast<double>(measured_.ray(ray.view, ray.x, ray.y)),
                                     static_cast<double>(values[i]), sums[view]));
    }
    result.grad_bias += projector_.backward(trace, values, gradient);
  }
  for (std::size_t v = 0; v < sums.size(); ++v) view_sums[v] += sums[v];
  return result;
}

}  // namespace tomofield::objective
