#include "prior/lattice.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "kernels/leaf_decoding.h"

namespace tomofield::prior {
namespace {

// Returns the vertex that stands for vertex `i`, which may be one beyond the lattice.
int mirrored(int i, int n) {
  if (n == 1) return 0;
  const int period = 2 * (n - 1);
  const int in_period = (i % period + period) % period;
  return std::min(in_period, period - in_period);
}

// Returns the value whose softplus with sharpness `beta` is `density`. A softplus is above 0, so
// smaller densities get the value of a small one.
float value_of(float density, float beta) {
  const float scaled = std::max(beta * density, 1e-3f);
  return (scaled + std::log1p(-std::exp(-scaled))) / beta;
}

int leaf_at(const field::Field& field, std::int64_t x, std::int64_t y) {
  return field.tree().find_leaf(static_cast<double>(x) + field::kPixelCentre,
                                static_cast<double>(y) + field::kPixelCentre);
}

}  // namespace

Lattice::Lattice(const field::Field& field, const Rectangle& roi)
    : field_(field), first_row_(roi.y0) {
  const int first = leaf_at(field, roi.x0, roi.y0);
  const field::Square& square = field.tree().leaf(first).square;
  leaf_size_ = static_cast<int>(square.size);
  TOMOFIELD_CHECK(field.kind() == FieldKind::kGrid && field.shape(first).nx == leaf_size_ + 1,
                  "plain vertices a pixel apart");
  shape_ = {static_cast<int>(roi.width()), field.shape(first).nz, static_cast<int>(roi.height())};
  x_ = places(roi.x0, shape_.nx, square.x0);
  y_ = places(roi.y0, shape_.ny, square.y0);
  num_columns_ = x_.back().cell + 1;
  for (int row = 0; row <= y_.back().cell; ++row)
    for (int column = 0; column < num_columns_; ++column)
      leaves_.push_back(leaf_at(field, square.x0 + std::int64_t{column} * leaf_size_,
                                square.y0 + std::int64_t{row} * leaf_size_));
}

std::vector<Lattice::Place> Lattice::places(std::int64_t first, int count,
                                            std::int64_t cells_begin) const {
  std::vector<Place> places;
  for (int i = 0; i < count; ++i) {
    const auto from_begin = static_cast<int>(first - cells_begin) + i;
    places.push_back({from_begin / leaf_size_, from_begin % leaf_size_});
  }
  return places;
}

base::Range Lattice::rows_of(base::Range bands) const {
  const field::RootGrid& roots = field_.tree().roots();
  const auto row_at = [&](int band) {
    const std::int64_t row = roots.y0 + band * roots.cell_size - first_row_;
    return static_cast<int>(std::clamp<std::int64_t>(row, 0, shape_.ny));
  };
  return {row_at(bands.begin), row_at(bands.end)};
}

void Lattice::read(std::span<const float> parameters, const Part& part,
                   std::span<float> box) const {
  const std::ptrdiff_t side = leaf_size_ + 1;
  std::vector<Place> rows;
  for (int y = part.y.begin; y < part.y.end; ++y)
    rows.push_back(y_[static_cast<std::size_t>(mirrored(y, shape_.ny))]);
  base::parallel_for("read lattice", part.x.size(), [&](std::int64_t i) {
    const Place x =
        x_[static_cast<std::size_t>(mirrored(part.x.begin + static_cast<int>(i), shape_.nx))];
    float* out = box.data() + i * part.z.size() * part.y.size();
    float* const first = out;
    for (int z = part.z.begin; z < part.z.end; ++z) {
      const std::ptrdiff_t row = x.vertex * shape_.nz + mirrored(z, shape_.nz);
      for (const Place& y : rows) {
        const int leaf = leaves_[static_cast<std::size_t>(y.cell * num_columns_ + x.cell)];
        *out++ = field_.bias +
                 parameters[field_.offset(leaf) + static_cast<std::size_t>(row * side + y.vertex)];
      }
    }
    kernels::activate(field_.activation, first, out - first);
  });
}

void Lattice::write(std::span<const float> box, const Part& part,
                    std::span<float> parameters) const {
  const std::ptrdiff_t side = leaf_size_ + 1;
  const float beta = field_.activation.beta;
  // Calls body with the places of a vertex along an axis: on a face it belongs to two leaves.
  const auto for_places = [&](const Place& place, const auto& body) {
    body(place);
    if (place.vertex == 0 && place.cell > 0) body(Place{place.cell - 1, leaf_size_});
  };
  base::parallel_for("write lattice", part.x.size(), [&](std::int64_t i) {
    const float* in = box.data() + i * part.z.size() * part.y.size();
    const auto at_x = static_cast<std::size_t>(part.x.begin + i);
    for (int z = part.z.begin; z < part.z.end; ++z) {
      for (int at = part.y.begin; at < part.y.end; ++at) {
        const float density = *in++;
        const float value = (beta > 0 ? value_of(density, beta) : density) - field_.bias;
        for_places(x_[at_x], [&](const Place& x) {
          for_places(y_[static_cast<std::size_t>(at)], [&](const Place& y) {
            const int leaf = leaves_[static_cast<std::size_t>(y.cell * num_columns_ + x.cell)];
            parameters[field_.offset(leaf) +
                       static_cast<std::size_t>((x.vertex * shape_.nz + z) * side + y.vertex)] =
                value;
          });
        });
      }
    }
  });
}

}  // namespace tomofield::prior
