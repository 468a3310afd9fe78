#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "baseline/neural/point_encoding.h"

namespace tomofield::baseline {

struct HashGridOptions {
  int levels = 8;
  double coarsest = 16.0, finest = 2.0;  ///< pixels between vertices
  int table_bits = 19;  ///< log2 of the largest number of vertices that a level stores
};

/// The multi-resolution hash grid of Müller et al. 2022: cubic grids from coarse to fine in
/// geometric steps, with two features a vertex, interpolated trilinearly at a point. A level with
/// more vertices than its table shares entries among them by a hash of the vertex. Parameters are
/// [level][entry][feature]; features are [level][feature].
class HashGrid final : public PointEncoding {
 public:
  HashGrid(const Point& box, const HashGridOptions& options);

  int num_features() const override;
  std::size_t num_parameters() const override { return num_parameters_; }
  /// Sets the parameters to uniform random numbers in ± 10⁻⁴.
  void initialize(std::uint64_t seed, std::span<float> parameters) const override;
  void encode(std::span<const Point> points, std::span<const float> parameters,
              float* features) const override;
  void accumulate(std::span<const Point> points, const float* grad_features,
                  std::span<float> grad_parameters) const override;

 private:
  struct Level {
    float per_pixel;                     ///< cells a pixel
    std::array<std::uint32_t, 3> cells;  ///< cells on each axis; there is one vertex more
    std::uint32_t mask;                  ///< entries − 1 if hashed, else 0
    std::size_t offset;                  ///< index of its first parameter
  };
  struct Corners;
  static Corners corners_of(const Level& level, const Point& point);

  std::vector<Level> levels_;
  std::size_t num_parameters_ = 0;
};

}  // namespace tomofield::baseline
