#include "align/local_gauge.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace tomofield::align {
namespace {

using geometry::ViewWarp;

constexpr int kSide = ViewWarp::kNodes, kNodes = kSide * kSide;

// Returns the weights of the specimen's nodes at the nodes of a view, [view's node, node].
Eigen::MatrixXd seen_weights(double cos_tilt) {
  Eigen::MatrixXd weights(kNodes, kNodes);
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const auto place = [](int node) { return static_cast<double>(node) / (kSide - 1) - 0.5; };
      const ViewWarp::Weights across = ViewWarp::node_weights(place(column) / cos_tilt);
      const ViewWarp::Weights along = ViewWarp::node_weights(place(row));
      for (int node = 0; node < kNodes; ++node)
        weights(row * kSide + column, node) = along[static_cast<std::size_t>(node / kSide)] *
                                              across[static_cast<std::size_t>(node % kSide)];
    }
  }
  return weights;
}

// Subtracts from one component of the motion its least-squares fit by the columns of `seen`.
void remove_fit(const Eigen::MatrixXd& seen, std::size_t axis,
                std::span<geometry::ViewCorrection> corrections) {
  Eigen::VectorXd motion(seen.rows());
  for (Eigen::Index i = 0; i < seen.rows(); ++i)
    motion[i] = corrections[static_cast<std::size_t>(i / kNodes)]
                    .local->nodes[static_cast<std::size_t>(i % kNodes)][axis];
  Eigen::MatrixXd normal = seen.transpose() * seen;
  normal.diagonal().array() += 1e-9 * static_cast<double>(corrections.size());
  const Eigen::VectorXd explained = seen * normal.ldlt().solve(seen.transpose() * motion);
  for (Eigen::Index i = 0; i < seen.rows(); ++i)
    corrections[static_cast<std::size_t>(i / kNodes)]
        .local->nodes[static_cast<std::size_t>(i % kNodes)][axis] -= explained[i];
}

}  // namespace

void remove_specimen_warp(const geometry::TiltGeometry& geometry,
                          std::span<geometry::ViewCorrection> corrections) {
  const auto rows = kNodes * std::ssize(corrections);
  Eigen::MatrixXd seen_x(rows, 2 * kNodes), seen_y(rows, kNodes);
  for (Eigen::Index view = 0; view < std::ssize(corrections); ++view) {
    const double cosine = geometry.cos_tilt(static_cast<int>(view));
    const Eigen::MatrixXd weights = seen_weights(cosine);
    seen_x.block<kNodes, kNodes>(kNodes * view, 0) = cosine * weights;
    seen_x.block<kNodes, kNodes>(kNodes * view, kNodes) =
        geometry.signed_sin_tilt(static_cast<int>(view)) * weights;
    seen_y.block<kNodes, kNodes>(kNodes * view, 0) = weights;
  }
  remove_fit(seen_x, 0, corrections);
  remove_fit(seen_y, 1, corrections);
}

}  // namespace tomofield::align
