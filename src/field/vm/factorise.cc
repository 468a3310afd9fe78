#include "field/vm/factorise.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "field/merge_target.h"
#include "field/vm/vm_field.h"

namespace tomofield::field {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Orthonormal columns along an axis: the leading ones, which represent most of the values, and the
// rest.
struct Basis {
  MatrixXd leading, rest;
};

// Returns the eigenvectors of a Gram matrix. The solver orders them by ascending eigenvalue.
Basis basis_of(const MatrixXd& gram, Index rank) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
  const Index leading = std::min(rank, gram.rows());
  return {eigen.eigenvectors().rightCols(leading).rowwise().reverse(),
          eigen.eigenvectors().leftCols(gram.rows() - leading)};
}

// The product vectors · matricesᵀ, with one column a rank.
struct Product {
  RowMajorMatrix vectors, matrices;
};

// Returns the closest product of a rank, from singular vectors of the shorter side.
Product closest_product(const RowMajorMatrix& values, Index rank) {
  if (values.cols() < values.rows()) {
    const MatrixXd right = basis_of(values.transpose() * values, rank).leading;
    return {values * right, right};
  }
  const MatrixXd left = basis_of(values * values.transpose(), rank).leading;
  return {left, values.transpose() * left};
}

// The vertex values of a leaf, [nx, nz·ny] or [nx·nz, ny].
class LeafValues {
 public:
  LeafValues(const LeafShape& s, const float* values) : nz_(s.nz), ny_(s.ny) {
    using Floats = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    values_ = Eigen::Map<const Floats>(values, s.nx, Index{s.nz} * s.ny).cast<double>();
    x_ = basis_of(values_ * values_.transpose(), s.rank_x);
    const RowMajorMatrix along_y = columns(values_);
    y_ = basis_of(along_y.transpose() * along_y, s.rank_y);
  }

  // Returns the product with vectors along x. It leaves out half of the part that vectors along y
  // can represent.
  Product along_x() const {
    RowMajorMatrix part = columns(values_);
    part -= 0.5 * (part * y_.leading) * y_.leading.transpose();
    const Eigen::Map<const RowMajorMatrix> lines(part.data(), values_.rows(), values_.cols());
    return {x_.leading, lines.transpose() * x_.leading};
  }

  Product along_y() const {
    const RowMajorMatrix part =
        values_ - 0.5 * x_.leading * (x_.leading.transpose() * values_).eval();
    return {y_.leading, columns(part) * y_.leading};
  }

  // Returns the product with vectors along z, for the part that neither x nor y can represent. It
  // works in the coordinates of the other basis vectors, which are few.
  Product along_z(Index rank) const {
    const Index rest_x = x_.rest.cols(), rest_y = y_.rest.cols();
    if (rest_x == 0 || rest_y == 0) return {};
    const RowMajorMatrix lines = x_.rest.transpose() * values_;
    const RowMajorMatrix rest = columns(lines) * y_.rest;  // [rest_x·nz, rest_y]
    RowMajorMatrix sections(nz_, rest_x * rest_y);
    for (Index i = 0; i < rest_x; ++i)
      sections.middleCols(i * rest_y, rest_y) = rest.middleRows(i * nz_, nz_);
    Product product = closest_product(sections, rank);
    product.matrices = at_vertices(product.matrices);
    return product;
  }

 private:
  Eigen::Map<const RowMajorMatrix> columns(const RowMajorMatrix& lines) const {
    return {lines.data(), lines.size() / ny_, ny_};
  }

  // Expands matrices [rest_x·rest_y, rank] to [nx·ny, rank].
  RowMajorMatrix at_vertices(const RowMajorMatrix& matrices) const {
    const Index rank = matrices.cols(), rest_y = y_.rest.cols();
    const Eigen::Map<const RowMajorMatrix> by_x(matrices.data(), x_.rest.cols(), rest_y * rank);
    const RowMajorMatrix rows = x_.rest * by_x;  // [nx, rest_y·rank]
    RowMajorMatrix all(rows.rows() * ny_, rank);
    for (Index i = 0; i < rows.rows(); ++i) {
      const Eigen::Map<const RowMajorMatrix> row(rows.row(i).data(), rest_y, rank);
      all.middleRows(i * ny_, ny_) = y_.rest * row;
    }
    return all;
  }

  Index nz_, ny_;
  RowMajorMatrix values_;
  Basis x_, y_;
};

double root_mean_square(const RowMajorMatrix& m, Index column) {
  return m.col(column).norm() / std::sqrt(static_cast<double>(m.rows()));
}

// Writes the first ranks of two factors [n, rank], balanced. Ranks that are zero to rounding are
// left out.
void write(const Product& product, Index rank, float* vectors, float* matrices) {
  constexpr double kNothing = 1e-12;
  for (Index r = 0; r < product.vectors.cols(); ++r) {
    const double of_vector = root_mean_square(product.vectors, r);
    const double of_matrix = root_mean_square(product.matrices, r);
    if (of_vector * of_matrix < kNothing) continue;
    const double scale = std::sqrt(of_matrix / of_vector);
    for (Index i = 0; i < product.vectors.rows(); ++i)
      vectors[i * rank + r] = static_cast<float>(scale * product.vectors(i, r));
    for (Index i = 0; i < product.matrices.rows(); ++i)
      matrices[i * rank + r] = static_cast<float>(product.matrices(i, r) / scale);
  }
}

void factorise(const LeafShape& s, const float* values, float* p) {
  const VmLayout at(s);
  const LeafValues leaf(s, values);
  write(leaf.along_x(), s.rank_x, p + at.vx, p + at.myz);
  write(leaf.along_y(), s.rank_y, p + at.vy, p + at.mxz);
  write(leaf.along_z(s.rank_z), s.rank_z, p + at.vz, p + at.mxy);
}

}  // namespace

// The copies are the values, what is left of them for an axis, and products of that size.
std::size_t factorising_memory(const LeafShape& shape) {
  constexpr std::size_t kCopies = 6;
  return kCopies * sizeof(double) * shape.vertices_xz() * static_cast<std::size_t>(shape.ny);
}

std::unique_ptr<Field> factorised(const Field& vertices, std::vector<LeafShape> shapes) {
  TOMOFIELD_CHECK(vertices.kind() == FieldKind::kGrid,
                  "plain vertices, which are their own values");
  auto factors =
      make_field(FieldKind::kVm, vertices.tree(), vertices.thickness(), std::move(shapes));
  factors->bias = vertices.bias;
  factors->activation = vertices.activation;
  std::vector<int> kept;
  for (int leaf = 0; leaf < vertices.tree().num_leaves(); ++leaf)
    if (vertices.keeps(leaf)) kept.push_back(leaf);
  factors->keep_only(kept);
  base::parallel_for("factorise leaves", std::ssize(kept), [&](std::int64_t i) {
    const int leaf = kept[static_cast<std::size_t>(i)];
    const LeafShape &from = vertices.shape(leaf), &to = factors->shape(leaf);
    TOMOFIELD_CHECK(from.nx == to.nx && from.ny == to.ny && from.nz == to.nz,
                    "new ranks, not vertices");
    factorise(to, vertices.parameters().data() + vertices.offset(leaf),
              factors->parameters().data() + factors->offset(leaf));
  });
  return factors;
}

}  // namespace tomofield::field
