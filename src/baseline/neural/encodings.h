#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace tomofield::baseline {

/// A position (x, y, z) in pixels. It is also the size of the box that positions lie in, from 0 on.
using Point = std::array<float, 3>;

/// The features of a position that a network receives. Some encodings have parameters, which are
/// fitted too.
class PointEncoding {
 public:
  virtual ~PointEncoding() = default;
  virtual int num_features() const = 0;
  virtual std::size_t num_parameters() const { return 0; }
  virtual void initialize(std::uint64_t /*seed*/, std::span<float> /*parameters*/) const {}
  /// Computes the features [point, feature].
  virtual void encode(std::span<const Point> points, std::span<const float> parameters,
                      float* features) const = 0;
  /// Adds the gradient of Σ grad_features · features to grad_parameters, on all threads. The result
  /// has the same bits for any number of threads.
  virtual void accumulate(std::span<const Point> /*points*/, const float* /*grad_features*/,
                          std::span<float> /*grad_parameters*/) const {}
};

/// Encodes a point by random Fourier features (Rahimi and Recht 2007; Tancik et al. 2020): plane
/// waves
///   sin(2π (b · point + φ))
/// of random phase φ and random direction. The frequency |b| is uniform up to 1 / `shortest`
/// pixels. The waves are fixed: there are no parameters.
class FourierEncoding final : public PointEncoding {
 public:
  FourierEncoding(int num_features, double shortest, std::uint64_t seed);
  int num_features() const override { return static_cast<int>(phase_.size()); }
  void encode(std::span<const Point> points, std::span<const float> parameters,
              float* features) const override;

 private:
  std::vector<float> x_, y_, z_, phase_;  // cycles a pixel, cycles
};

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
