#include "simulate/project_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "simulate/gaussian_rows.h"
#include "simulate/line_integrals.h"

namespace tomofield::simulate {
namespace {

using Vector = geometry::ViewWarp::Vector;

// Holds the places in the aligned view of the pixels of a band of recorded rows.
class Band {
 public:
  Band(const ViewFrame& view, std::int64_t first_row, std::int64_t num_rows)
      : map_(view.raw_from_aligned),
        origin_{0.5 - static_cast<double>(view.width) / 2.0,
                static_cast<double>(first_row) + 0.5 - static_cast<double>(view.height) / 2.0},
        width_(view.width),
        num_rows_(num_rows),
        motion_(view.warp ? view.warp->largest_component() : 0.0) {
    const io::ImodTransform aligned = geometry::invert(map_);
    places_.reserve(static_cast<std::size_t>(width_ * num_rows));
    for (std::int64_t row = 0; row < num_rows; ++row) {
      for (std::int64_t column = 0; column < width_; ++column) {
        const double px = origin_[0] + static_cast<double>(column);
        const double py = origin_[1] + static_cast<double>(row);
        Vector q{aligned.a11 * px + aligned.a12 * py + aligned.shift_x_px,
                 aligned.a21 * px + aligned.a22 * py + aligned.shift_y_px};
        if (view.warp) {
          const Vector d = view.warp->displacement(q[0], q[1]);
          q = {q[0] + d[0], q[1] + d[1]};
        }
        places_.push_back(q);
      }
    }
  }

  // Calls visit(pixel, dx, dy) for each pixel that lies within `reach` of a place of the aligned
  // view. (dx, dy) is its offset from there.
  template <typename Visit>
  void visit_near(const Vector& center, double reach, const Visit& visit) const {
    // Before its displacement, a pixel that gets near lies in a square of this half side.
    const double half = reach + motion_;
    const double x = map_.m11 * center[0] + map_.m12 * center[1] + map_.shift_x_px;
    const double y = map_.m21 * center[0] + map_.m22 * center[1] + map_.shift_y_px;
    const IndexRange columns =
        indices_near(x, (std::abs(map_.m11) + std::abs(map_.m12)) * half, origin_[0], width_);
    const IndexRange rows =
        indices_near(y, (std::abs(map_.m21) + std::abs(map_.m22)) * half, origin_[1], num_rows_);
    for (std::int64_t row = rows.first; row < rows.last; ++row) {
      for (std::int64_t column = columns.first; column < columns.last; ++column) {
        const auto pixel = static_cast<std::size_t>(row * width_ + column);
        const double dx = places_[pixel][0] - center[0], dy = places_[pixel][1] - center[1];
        if (dx * dx + dy * dy < reach * reach) visit(pixel, dx, dy);
      }
    }
  }

  const std::vector<Vector>& places() const { return places_; }

 private:
  geometry::RawFromAligned map_;
  Vector origin_;  // place of the first pixel in the recorded view
  std::int64_t width_, num_rows_;
  double motion_;  // no pixel is displaced farther along x or y
  std::vector<Vector> places_;
};

}  // namespace

void add_pixels(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                std::span<double> sums) {
  const Beam beam(view.tilt_deg);
  const Band band(view, first_row, static_cast<std::int64_t>(sums.size()) / view.width);
  for (std::size_t pixel = 0; pixel < sums.size(); ++pixel) {
    const Vector& q = band.places()[pixel];
    sums[pixel] += slab_integral(phantom, beam, q[0], q[1]);
  }
  for (const Ellipsoid& body : phantom.bodies) {
    const EllipsoidIntegral integral(body, beam);
    band.visit_near(
        {beam.u_of(body.center), body.center[1]}, body.reach(),
        [&](std::size_t pixel, double dx, double dy) { sums[pixel] += integral(dx, dy); });
  }
  const double half_thickness = static_cast<double>(phantom.shape.nz) / 2.0;
  for (const Blob& blob : phantom.blobs) {
    const BlobIntegral integral(blob, beam, half_thickness);
    const double per_square = -0.5 / (blob.sigma * blob.sigma);
    band.visit_near({beam.u_of(blob.center), blob.center[1]}, blob.reach(),
                    [&](std::size_t pixel, double dx, double dy) {
                      sums[pixel] += integral(band.places()[pixel][0]) *
                                     std::exp(per_square * (dx * dx + dy * dy));
                    });
  }
}

}  // namespace tomofield::simulate
