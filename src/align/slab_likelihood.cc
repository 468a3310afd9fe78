#include "align/slab_likelihood.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Eigenvalues>

#include "base/parallel.h"

namespace tomofield::align {
namespace {

constexpr double kTinyEigenvalue = 1e-3;
constexpr int kCoherenceSteps = 49;  // from 0 to 0.98

double coherence_of_step(int step) { return 0.02 * step; }

// Returns c Λ / (c Λ + 1 − c): what the inverse covariance takes away from each mode.
Eigen::VectorXd removed_share(const Eigen::VectorXd& eigenvalues, double coherence) {
  return (coherence * eigenvalues.array() / (coherence * eigenvalues.array() + 1.0 - coherence))
      .matrix();
}

Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

}  // namespace

SlabLikelihood::SlabLikelihood(const SlabModel& model)
    : model_(&model), columns_(model.columns().size()) {
  base::parallel_for("slab modes", std::ssize(columns_), [&](std::int64_t c) {
    const double fx = model.columns()[static_cast<std::size_t>(c)].fx;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(model.correlation(fx));
    const auto count = (solver.eigenvalues().array() > kTinyEigenvalue).count();
    Column& column = columns_[static_cast<std::size_t>(c)];
    column.basis = solver.eigenvectors().rightCols(count);
    column.eigenvalues = solver.eigenvalues().tail(count);
    for (std::size_t v = 0; v < model.num_views(); ++v) column.num_views += model.has_signal(v, fx);
  });
  for (const FrequencyColumn& column : model.columns())
    for (const int shell : column.shell)
      num_shells_ = std::max(num_shells_, static_cast<std::size_t>(shell) + 1);
}

void SlabLikelihood::normalise(Spectra& spectra) const {
  const auto divide_by_shells = [&] {
    std::vector<double> power(num_shells_), count(num_shells_);
    for (std::size_t c = 0; c < columns_.size(); ++c)
      for (std::size_t k = 0; k < model_->columns()[c].ky.size(); ++k) {
        const auto shell = static_cast<std::size_t>(model_->columns()[c].shell[k]);
        power[shell] += spectra[c].col(index(k)).squaredNorm();
        count[shell] += columns_[c].num_views;
      }
    for (std::size_t c = 0; c < columns_.size(); ++c)
      for (std::size_t k = 0; k < model_->columns()[c].ky.size(); ++k) {
        const auto shell = static_cast<std::size_t>(model_->columns()[c].shell[k]);
        if (power[shell] > 0.0)
          spectra[c].col(index(k)) *= std::sqrt(count[shell] / power[shell]);
      }
  };
  const auto divide_by_views = [&] {
    Eigen::VectorXd power = Eigen::VectorXd::Zero(index(model_->num_views())), count = power;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      power += spectra[c].rowwise().squaredNorm();
      for (std::size_t v = 0; v < model_->num_views(); ++v)
        if (model_->has_signal(v, model_->columns()[c].fx))
          count[index(v)] += static_cast<double>(spectra[c].cols());
    }
    for (Eigen::Index v = 0; v < power.size(); ++v)
      if (power[v] > 0.0)
        for (Eigen::MatrixXcd& column : spectra) column.row(v) *= std::sqrt(count[v] / power[v]);
  };
  divide_by_shells();
  divide_by_views();
  divide_by_shells();
}

double SlabLikelihood::cost_of(const Column& column, double coherence, double power,
                               const Eigen::VectorXd& mode_power) const {
  const double noise = 1.0 - coherence;
  const auto modes = static_cast<double>(column.eigenvalues.size());
  return (column.num_views - modes) * std::log(noise) +
         (coherence * column.eigenvalues.array() + noise).log().sum() +
         (power - removed_share(column.eigenvalues, coherence).dot(mode_power)) / noise;
}

std::vector<double> SlabLikelihood::estimate_coherence(const Spectra& spectra) const {
  std::vector<Eigen::MatrixXd> parts(columns_.size());  // [shell, step]
  base::parallel_for("coherence", std::ssize(columns_), [&](std::int64_t index_of_column) {
    const auto c = static_cast<std::size_t>(index_of_column);
    parts[c] = Eigen::MatrixXd::Zero(index(num_shells_), kCoherenceSteps);
    const Eigen::MatrixXd mode_power =
        (columns_[c].basis.transpose() * spectra[c]).array().abs2().matrix();
    for (std::size_t k = 0; k < model_->columns()[c].ky.size(); ++k)
      for (int step = 0; step < kCoherenceSteps; ++step)
        parts[c](model_->columns()[c].shell[k], step) +=
            cost_of(columns_[c], coherence_of_step(step), spectra[c].col(index(k)).squaredNorm(),
                    mode_power.col(index(k)));
  });
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(index(num_shells_), kCoherenceSteps);
  for (const Eigen::MatrixXd& part : parts) sums += part;
  std::vector<double> coherence;
  for (Eigen::Index shell = 0; shell < sums.rows(); ++shell) {
    Eigen::Index best = 0;
    sums.row(shell).minCoeff(&best);
    coherence.push_back(coherence_of_step(static_cast<int>(best)));
  }
  return coherence;
}

double SlabLikelihood::cost(const Spectra& spectra, const std::vector<double>& coherence) const {
  std::vector<double> parts(columns_.size());
  base::parallel_for("likelihood", std::ssize(columns_), [&](std::int64_t index_of_column) {
    const auto c = static_cast<std::size_t>(index_of_column);
    const Eigen::MatrixXd mode_power =
        (columns_[c].basis.transpose() * spectra[c]).array().abs2().matrix();
    for (std::size_t k = 0; k < model_->columns()[c].ky.size(); ++k)
      parts[c] += cost_of(columns_[c], coherence[static_cast<std::size_t>(model_->columns()[c].shell[k])],
                          spectra[c].col(index(k)).squaredNorm(), mode_power.col(index(k)));
  });
  double sum = 0.0;
  for (const double part : parts) sum += part;
  return sum;
}

PositionDerivatives SlabLikelihood::derivatives(const Spectra& spectra,
                                                const std::vector<double>& coherence) const {
  const Eigen::Index n = index(model_->num_views());
  std::vector<PositionDerivatives> parts(columns_.size());
  base::parallel_for("derivatives", std::ssize(columns_), [&](std::int64_t index_of_column) {
    const auto c = static_cast<std::size_t>(index_of_column);
    const FrequencyColumn& frequencies = model_->columns()[c];
    std::map<int, std::vector<std::size_t>> rows_of_shell;
    for (std::size_t k = 0; k < frequencies.ky.size(); ++k)
      rows_of_shell[frequencies.shell[k]].push_back(k);
    Eigen::VectorXd gradient_x = Eigen::VectorXd::Zero(n), gradient_y = gradient_x;
    Eigen::MatrixXd xx = Eigen::MatrixXd::Zero(n, n), xy = xx, yy = xx;
    for (const auto& [shell, rows] : rows_of_shell) {
      const double share = coherence[static_cast<std::size_t>(shell)];
      if (share == 0.0) continue;
      const Eigen::VectorXd removed = removed_share(columns_[c].eigenvalues, share);
      // The rest of K⁻¹ is a multiple of the identity, which does not see positions.
      const Eigen::MatrixXd inverse = -1.0 / (1.0 - share) * columns_[c].basis *
                                      removed.asDiagonal() * columns_[c].basis.transpose();
      for (const std::size_t k : rows) {
        const Eigen::VectorXcd z = spectra[c].col(index(k));
        const Eigen::VectorXd re = z.real(), im = z.imag();
        const Eigen::VectorXd kre = inverse * re, kim = inverse * im;
        const Eigen::VectorXd slope = (re.array() * kim.array() - im.array() * kre.array()).matrix();
        const double wx = 2.0 * std::numbers::pi * frequencies.fx;
        const double wy = 2.0 * std::numbers::pi * frequencies.fy[k];
        gradient_x += 2.0 * wx * slope;
        gradient_y += 2.0 * wy * slope;
        const Eigen::MatrixXd pair =
            2.0 * inverse.cwiseProduct(re * re.transpose() + im * im.transpose());
        xx += wx * wx * pair;
        xy += wx * wy * pair;
        yy += wy * wy * pair;
      }
    }
    PositionDerivatives& part = parts[c];
    part.gradient.resize(2 * n);
    part.gradient << gradient_x, gradient_y;
    part.hessian.resize(2 * n, 2 * n);
    // A translation of all views changes nothing, so the rows of each block add up to 0.
    for (Eigen::MatrixXd* block : {&xx, &xy, &yy}) {
      block->diagonal().setZero();
      const Eigen::VectorXd sums = block->rowwise().sum();
      block->diagonal() = -sums;
    }
    part.hessian << xx, xy, xy, yy;
  });
  PositionDerivatives sum = std::move(parts.front());
  for (std::size_t c = 1; c < parts.size(); ++c) {
    sum.gradient += parts[c].gradient;
    sum.hessian += parts[c].hessian;
  }
  return sum;
}

}  // namespace tomofield::align
