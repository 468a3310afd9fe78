#include "baseline/neural/network_density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/threads/parallel.h"
#include "fit/domain.h"
#include "kernels/lanes.h"
#include "tomofield/options.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

// The number of columns that go through the network at once: few enough for the L2 cache.
constexpr int kChunk = 128;

// The sharpness β of softplus per density unit, as in the main method.
constexpr float kSharpness = static_cast<float>(fit::FieldStart{}.sharpness);

// The number of parts of a slab whose gradients are summed separately. Their order, not the order
// of the threads, decides the bits.
constexpr std::size_t kParts = 16;

DenseNetwork network_of(const PointEncoding& encoding, const NetworkDensity::Shape& shape) {
  std::vector<int> widths{encoding.num_features()};
  widths.insert(widths.end(), static_cast<std::size_t>(shape.hidden_layers), shape.width);
  return DenseNetwork(std::move(widths), shape.activation);
}

double lowest_x(const projection::SampleGrid& grid) {
  double low = std::numeric_limits<double>::infinity();
  for (const projection::SampleSegment& segment : grid.segments()) low = std::min(low, segment.x0);
  return low;
}

// Returns the bias that is added to the network's output.
float bias_of(const NetworkDensity::Shape& shape) {
  return static_cast<float>(
      fit::bias_of_density(shape.mean_density, shape.non_negative ? kSharpness : 0));
}

// Calls body(i, sample) for the i-th point of some columns. `sample` is an index from the first
// column on, within its z row.
template <typename Body>
void for_each_point(int num_columns, const RowSet& rows, Body&& body) {
  std::size_t i = 0;
  for (int column = 0; column < num_columns; ++column) {
    for (int row = 0; row < rows.num_rows; ++row)
      body(i++, column * static_cast<int>(kLanes) + rows.first + row * RowSet::kStride);
  }
}

std::ptrdiff_t first_sample(const projection::SampleSegment& segment, int k, int column) {
  return segment.origin + k * segment.stride_z() + column * kLanes;
}

float softplus(float x) {
  return std::max(x, 0.0f) + std::log1p(std::exp(-kSharpness * std::abs(x))) / kSharpness;
}
float softplus_slope(float x) { return 1 / (1 + std::exp(-kSharpness * x)); }

}  // namespace

std::uint16_t RowSet::lanes() const {
  unsigned bits = 0;
  for (int row = 0; row < num_rows; ++row) bits |= 1u << (first + row * kStride);
  return static_cast<std::uint16_t>(bits);
}

std::vector<RowSet> RowSet::all(std::int64_t num_rows) {
  std::vector<RowSet> sets;
  for (int slab = 0; slab * kLanes < num_rows; ++slab) {
    const int of_slab = static_cast<int>(std::min<std::int64_t>(kLanes, num_rows - slab * kLanes));
    for (int first = 0; first < std::min(kStride, of_slab); ++first)
      sets.push_back({slab, first, (of_slab - first + kStride - 1) / kStride});
  }
  return sets;
}

Point box_of(const projection::SampleGrid& grid, std::int64_t num_rows) {
  double high_x = 0, depth = 0;
  for (const projection::SampleSegment& segment : grid.segments()) {
    high_x = std::max(high_x, segment.x1());
    depth = std::max(depth, segment.nz * segment.hz);
  }
  return {static_cast<float>(high_x - lowest_x(grid)), static_cast<float>(num_rows),
          static_cast<float>(depth)};
}

NetworkDensity::NetworkDensity(const projection::SampleGrid& grid, std::int64_t num_rows,
                               std::unique_ptr<PointEncoding> encoding, const Shape& shape)
    : low_x_(lowest_x(grid)),
      encoding_(std::move(encoding)),
      network_(network_of(*encoding_, shape)),
      non_negative_(shape.non_negative),
      bias_(bias_of(shape)) {
  for (const projection::SampleSegment& segment : grid.segments()) {
    for (int k = 0; k < segment.nz; ++k) {
      for (int first = 0; first < segment.nx; first += kChunk) {
        chunks_.push_back({&segment, k, first, std::min(kChunk, segment.nx - first), num_columns_});
        num_columns_ += static_cast<std::size_t>(chunks_.back().size);
      }
    }
  }
  const Counts counts = counts_of(grid, num_rows, *encoding_, network_);
  parameters_ = base::AlignedBuffer<float>(counts.parameters);
  points_.resize(counts.points);
  grad_features_.resize(counts.grad_features);
  parts_.resize(counts.parts);
  encoding_->initialize(shape.seed, parameters());
  network_.initialize(shape.seed + 1, parameters().subspan(encoding_->num_parameters()));
}

NetworkDensity::Counts NetworkDensity::counts_of(const projection::SampleGrid& grid,
                                                 std::int64_t num_rows,
                                                 const PointEncoding& encoding,
                                                 const DenseNetwork& network) {
  std::size_t columns = 0;
  for (const projection::SampleSegment& segment : grid.segments())
    columns += static_cast<std::size_t>(segment.nx) * static_cast<std::size_t>(segment.nz);
  const std::int64_t max_rows =
      (std::min<std::int64_t>(num_rows, kLanes) + RowSet::kStride - 1) / RowSet::kStride;
  const std::size_t points = columns * static_cast<std::size_t>(max_rows);
  const bool is_fitted = encoding.num_parameters() > 0;
  return {
      .parameters = encoding.num_parameters() + network.num_parameters(),
      .points = points,
      .grad_features = is_fitted ? points * static_cast<std::size_t>(encoding.num_features()) : 0,
      .parts = kParts * network.num_parameters()};
}

MethodSize NetworkDensity::size(const projection::SampleGrid& grid, std::int64_t num_rows,
                                const PointEncoding& encoding, const Shape& shape,
                                int num_threads) {
  const DenseNetwork network = network_of(encoding, shape);
  const Counts counts = counts_of(grid, num_rows, encoding, network);
  const std::size_t batch = kChunk * (kLanes / RowSet::kStride) * network.values_per_point();
  return {counts.parameters,
          sizeof(Point) * counts.points +
              sizeof(float) * (counts.parameters + counts.grad_features + counts.parts +
                               static_cast<std::size_t>(num_threads) * batch)};
}

std::span<const float> NetworkDensity::encoding_parameters() const {
  return {parameters_.data(), encoding_->num_parameters()};
}

std::span<const float> NetworkDensity::network_parameters() const {
  return {parameters_.data() + encoding_->num_parameters(), network_.num_parameters()};
}

std::span<Point> NetworkDensity::points_of(const Chunk& chunk, const RowSet& rows) {
  const auto num_rows = static_cast<std::size_t>(rows.num_rows);
  return std::span(points_).subspan(chunk.index * num_rows,
                                    static_cast<std::size_t>(chunk.size) * num_rows);
}

// Returns the arguments of softplus.
std::span<float> NetworkDensity::evaluate(const Chunk& chunk, const RowSet& rows,
                                          DenseNetwork::Batch& batch) {
  const projection::SampleSegment& s = *chunk.segment;
  const std::span<Point> points = points_of(chunk, rows);
  for_each_point(chunk.size, rows, [&](std::size_t i, int sample) {
    const int column = chunk.first + sample / static_cast<int>(kLanes);
    const int row = rows.slab * static_cast<int>(kLanes) + sample % static_cast<int>(kLanes);
    points[i] = {static_cast<float>(s.x0 + (column + 0.5) * s.hx - low_x_),
                 static_cast<float>(row) + 0.5f, static_cast<float>((chunk.k + 0.5) * s.hz)};
  });
  const int num_points = static_cast<int>(points.size());
  encoding_->encode(points, encoding_parameters(), network_.inputs(num_points, batch));
  const std::span<float> values = network_.forward(network_parameters(), num_points, batch);
  for (float& value : values) value += bias_;
  return values;
}

void NetworkDensity::decode(const RowSet& rows, float* samples) {
  base::parallel_for("network", std::ssize(chunks_), [&](std::int64_t index) {
    thread_local DenseNetwork::Batch batch;
    const Chunk& chunk = chunks_[static_cast<std::size_t>(index)];
    const std::span<const float> values = evaluate(chunk, rows, batch);
    float* out = samples + first_sample(*chunk.segment, chunk.k, chunk.first);
    for_each_point(chunk.size, rows, [&](std::size_t i, int sample) {
      out[sample] = non_negative_ ? softplus(values[i]) : values[i];
    });
  });
}

void NetworkDensity::accumulate(const RowSet& rows, const float* grad_samples,
                                std::span<float> gradient) {
  const std::size_t count = network_.num_parameters();
  base::parallel_for("network gradient", kParts, [&](std::int64_t part) {
    thread_local DenseNetwork::Batch batch;
    const std::size_t p = static_cast<std::size_t>(part);
    const std::span<float> sum = std::span(parts_).subspan(p * count, count);
    std::ranges::fill(sum, 0.0f);
    for (std::size_t c = p; c < chunks_.size(); c += kParts)
      accumulate_chunk(chunks_[c], rows, grad_samples, batch, sum);
  });
  const std::span<float> of_network = gradient.subspan(encoding_->num_parameters());
  for (std::size_t p = 0; p < kParts; ++p)
    for (std::size_t i = 0; i < count; ++i) of_network[i] += parts_[p * count + i];
  const std::size_t num_points = num_columns_ * static_cast<std::size_t>(rows.num_rows);
  encoding_->accumulate(std::span(points_).first(num_points), grad_features_.data(), gradient);
}

void NetworkDensity::accumulate_chunk(const Chunk& chunk, const RowSet& rows,
                                      const float* grad_samples, DenseNetwork::Batch& batch,
                                      std::span<float> gradient) {
  const std::span<float> values = evaluate(chunk, rows, batch);
  const float* g = grad_samples + first_sample(*chunk.segment, chunk.k, chunk.first);
  for_each_point(chunk.size, rows, [&](std::size_t i, int sample) {
    values[i] = g[sample] * (non_negative_ ? softplus_slope(values[i]) : 1.0f);
  });
  const std::span<const float> by_features =
      network_.backward(network_parameters(), values, batch, gradient);
  if (grad_features_.empty()) return;
  const std::size_t first = chunk.index * static_cast<std::size_t>(rows.num_rows) *
                            static_cast<std::size_t>(encoding_->num_features());
  std::ranges::copy(by_features, grad_features_.data() + first);
}

}  // namespace tomofield::baseline
