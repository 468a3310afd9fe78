#include "baseline/neural/encodings.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "baseline/neural/dense_network.h"

namespace tomofield::baseline {
namespace {

constexpr std::ptrdiff_t kFeatures = 2;  // features of a vertex
constexpr unsigned kCorners = 8;

}  // namespace

FourierEncoding::FourierEncoding(int num_features, double shortest, std::uint64_t seed) {
  base::Random random(seed);
  for (int i = 0; i < num_features; ++i) {
    const double frequency = random.uniform() / shortest;
    const double b[] = {random.normal(), random.normal(), random.normal()};
    const double scale = frequency / std::hypot(b[0], b[1], b[2]);
    x_.push_back(static_cast<float>(scale * b[0]));
    y_.push_back(static_cast<float>(scale * b[1]));
    z_.push_back(static_cast<float>(scale * b[2]));
    phase_.push_back(static_cast<float>(random.uniform()));
  }
}

void FourierEncoding::encode(std::span<const Point> points, std::span<const float>,
                             float* features) const {
  const std::size_t count = phase_.size();
  for (const auto& [x, y, z] : points) {
    for (std::size_t i = 0; i < count; ++i)
      features[i] = sine_of_cycles(x_[i] * x + y_[i] * y + z_[i] * z + phase_[i]);
    features += count;
  }
}

// The vertices around a point: the place of their features and their weights.
struct HashGrid::Corners {
  std::array<std::size_t, kCorners> offset;
  std::array<float, kCorners> weight;
};

HashGrid::HashGrid(const Point& box, const HashGridOptions& options) {
  const double steps = std::max(options.levels - 1, 1);
  const std::uint64_t max_entries = std::uint64_t{1} << options.table_bits;
  for (int l = 0; l < options.levels; ++l) {
    const double spacing =
        options.coarsest * std::pow(options.finest / options.coarsest, l / steps);
    Level level{static_cast<float>(1 / spacing), {}, 0, num_parameters_};
    std::uint64_t entries = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double cells = std::ceil(static_cast<double>(box[axis]) / spacing);
      level.cells[axis] = static_cast<std::uint32_t>(std::max(cells, 1.0));
      entries *= level.cells[axis] + 1;
    }
    if (entries > max_entries) level.mask = static_cast<std::uint32_t>(max_entries - 1);
    num_parameters_ += std::min(entries, max_entries) * kFeatures;
    levels_.push_back(level);
  }
}

int HashGrid::num_features() const { return static_cast<int>(kFeatures * std::ssize(levels_)); }

void HashGrid::initialize(std::uint64_t seed, std::span<float> parameters) const {
  constexpr double kReach = 1e-4;
  base::Random random(seed);
  for (float& p : parameters.first(num_parameters_))
    p = static_cast<float>(random.uniform(-kReach, kReach));
}

HashGrid::Corners HashGrid::corners_of(const Level& level, const Point& point) {
  std::array<std::uint32_t, 3> low;
  std::array<float, 3> part;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float at = std::max(point[axis], 0.0f) * level.per_pixel;
    low[axis] = std::min(static_cast<std::uint32_t>(at), level.cells[axis] - 1);
    part[axis] = std::min(at - static_cast<float>(low[axis]), 1.0f);
  }
  // The entry is the index of the vertex or its hash (Müller et al., equation 4). Both have one
  // factor an axis.
  const bool is_hashed = level.mask != 0;
  const std::uint32_t factor_y = is_hashed ? 2654435761u : level.cells[0] + 1;
  const std::uint32_t factor_z =
      is_hashed ? 805459861u : (level.cells[0] + 1) * (level.cells[1] + 1);
  Corners corners;
  for (unsigned c = 0; c < kCorners; ++c) {
    const unsigned up_x = c & 1, up_y = c >> 1 & 1, up_z = c >> 2;
    const std::uint32_t x = low[0] + up_x, y = (low[1] + up_y) * factor_y,
                        z = (low[2] + up_z) * factor_z;
    const std::size_t entry = is_hashed ? (x ^ y ^ z) & level.mask : x + y + z;
    corners.offset[c] = level.offset + kFeatures * entry;
    corners.weight[c] = (up_x != 0 ? part[0] : 1 - part[0]) * (up_y != 0 ? part[1] : 1 - part[1]) *
                        (up_z != 0 ? part[2] : 1 - part[2]);
  }
  return corners;
}

void HashGrid::encode(std::span<const Point> points, std::span<const float> parameters,
                      float* features) const {
  for (const Level& level : levels_) {
    float* out = features;
    for (const Point& point : points) {
      const Corners corners = corners_of(level, point);
      float sum[kFeatures] = {};
      for (unsigned c = 0; c < kCorners; ++c) {
        const float* p = parameters.data() + corners.offset[c];
        for (int f = 0; f < kFeatures; ++f) sum[f] += corners.weight[c] * p[f];
      }
      std::copy_n(sum, kFeatures, out);
      out += num_features();
    }
    features += kFeatures;
  }
}

void HashGrid::accumulate(std::span<const Point> points, const float* grad_features,
                          std::span<float> grad_parameters) const {
  // The entries of a level belong to it alone, so levels may run at once.
  base::parallel_for("encode", std::ssize(levels_), [&](std::int64_t l) {
    const float* g = grad_features + kFeatures * l;
    for (const Point& point : points) {
      const Corners corners = corners_of(levels_[static_cast<std::size_t>(l)], point);
      for (unsigned c = 0; c < kCorners; ++c) {
        float* p = grad_parameters.data() + corners.offset[c];
        for (int f = 0; f < kFeatures; ++f) p[f] += corners.weight[c] * g[f];
      }
      g += num_features();
    }
  });
}

}  // namespace tomofield::baseline
