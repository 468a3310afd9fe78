#include "kernels/point_products.h"

#include <gtest/gtest.h>

#include <vector>

#include "base/random.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;

constexpr int kPoints = 37, kNa = 5, kNb = 4, kNc = 6;

struct Axis {
  std::vector<int> lower;
  std::vector<float> fraction;
  // Includes points at vertices, also at the last one.
  Axis(int num_vertices, std::uint64_t seed) {
    base::Random random(seed);
    for (int n = 0; n < kPoints; ++n) {
      lower.push_back(static_cast<int>(random.below(static_cast<std::uint64_t>(num_vertices - 1))));
      fraction.push_back(n % 5 == 0 ? static_cast<float>(random.below(2))
                                    : static_cast<float>(random.uniform()));
    }
  }
  AxisTaps taps() const { return {kPoints, lower.data(), fraction.data()}; }
  double weight(int point, int vertex) const {
    const auto n = static_cast<std::size_t>(point);
    const double f = static_cast<double>(fraction[n]);
    return vertex == lower[n] ? 1.0 - f : vertex == lower[n] + 1 ? f : 0.0;
  }
};

// Computes the definition in double: every vertex of every axis with its hat weight.
struct Expected {
  std::vector<double> values, grad_vector, grad_matrix;

  Expected(const Axis& a, const Axis& b, const Axis& c, int rank, const std::vector<float>& vector,
           const std::vector<float>& matrix, const std::vector<float>& grad_values)
      : values(kPoints, 0.5), grad_vector(vector.size()), grad_matrix(matrix.size()) {
    const auto term = [&](int n, int i, int jk, double weight) {
      for (int r = 0; r < rank; ++r) {
        const auto v = static_cast<std::size_t>(i * rank + r);
        const auto m = static_cast<std::size_t>(jk * rank + r);
        const double g = weight * static_cast<double>(grad_values[static_cast<std::size_t>(n)]);
        const double at_v = static_cast<double>(vector[v]), at_m = static_cast<double>(matrix[m]);
        values[static_cast<std::size_t>(n)] += weight * at_v * at_m;
        grad_vector[v] += g * at_m;
        grad_matrix[m] += g * at_v;
      }
    };
    for (int n = 0; n < kPoints; ++n) {
      for (int i = 0; i < kNa; ++i) {
        for (int j = 0; j < kNb; ++j) {
          for (int k = 0; k < kNc; ++k)
            term(n, i, j * kNc + k, a.weight(n, i) * b.weight(n, j) * c.weight(n, k));
        }
      }
    }
  }
};

TEST(PointProducts, ValuesAndAdjointAreTheDefinition) {
  const Axis a(kNa, 1), b(kNb, 2), c(kNc, 3);
  for_each_simd_target([&] {
    for (const int rank : {1, 2, 4, 7, 16, 21, 33}) {
      SCOPED_TRACE(rank);
      const auto vector = random_floats(static_cast<std::size_t>(kNa * rank), 4);
      const auto matrix = random_floats(static_cast<std::size_t>(kNb * kNc * rank), 5);
      const auto grad_values = random_floats(kPoints, 6);
      const Expected expected(a, b, c, rank, vector, matrix, grad_values);
      const PointProducts points{a.taps(), b.taps(), c.taps(), kNc, rank};

      std::vector<float> values(kPoints, 0.5f);  // the kernel adds to these
      std::vector<float> grad_vector(vector.size()), grad_matrix(matrix.size());
      add_point_products(points, vector.data(), matrix.data(), values.data());
      add_point_products_gradient(points, vector.data(), matrix.data(), grad_values.data(),
                                  grad_vector.data(), grad_matrix.data());
      expect_near(values, expected.values, 4e-6);
      expect_near(grad_vector, expected.grad_vector, 4e-6);
      expect_near(grad_matrix, expected.grad_matrix, 4e-6);
    }
  });
}

}  // namespace
}  // namespace tomofield::kernels
