#include "align/slab_likelihood.h"

#include <algorithm>
#include <cmath>

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

void SlabLikelihood::divide_by_shells(Spectra& spectra) const {
  std::vector<double> power(num_shells_), count(num_shells_);
  for (std::size_t c = 0; c < columns_.size(); ++c)
    for (std::size_t k = 0; k < model_->columns()[c].shell.size(); ++k) {
      const auto shell = static_cast<std::size_t>(model_->columns()[c].shell[k]);
      power[shell] += spectra[c].col(index(k)).squaredNorm();
      count[shell] += columns_[c].num_views;
    }
  for (std::size_t c = 0; c < columns_.size(); ++c)
    for (std::size_t k = 0; k < model_->columns()[c].shell.size(); ++k) {
      const auto shell = static_cast<std::size_t>(model_->columns()[c].shell[k]);
      if (power[shell] > 0.0) spectra[c].col(index(k)) *= std::sqrt(count[shell] / power[shell]);
    }
}

void SlabLikelihood::divide_by_views(Spectra& spectra) const {
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
}

// Views would look stronger or weaker than they are if shells were not of equal power first.
void SlabLikelihood::normalise(Spectra& spectra) const {
  divide_by_shells(spectra);
  divide_by_views(spectra);
  divide_by_shells(spectra);
}

double SlabLikelihood::cost_of(const Column& column, double coherence, double power,
                               const Eigen::VectorXd& mode_power) const {
  const double noise = 1.0 - coherence;
  const auto modes = static_cast<double>(column.eigenvalues.size());
  return (column.num_views - modes) * std::log(noise) +
         (coherence * column.eigenvalues.array() + noise).log().sum() +
         (power - removed_share(column.eigenvalues, coherence).dot(mode_power)) / noise;
}

double SlabLikelihood::cost(Spectra spectra) const {
  normalise(spectra);
  std::vector<Eigen::MatrixXd> parts(columns_.size());  // [shell, step]
  base::parallel_for("slab likelihood", std::ssize(columns_), [&](std::int64_t task) {
    const auto c = static_cast<std::size_t>(task);
    parts[c] = Eigen::MatrixXd::Zero(index(num_shells_), kCoherenceSteps);
    const Eigen::MatrixXd mode_power =
        (columns_[c].basis.transpose() * spectra[c]).array().abs2().matrix();
    for (std::size_t k = 0; k < model_->columns()[c].shell.size(); ++k)
      for (int step = 0; step < kCoherenceSteps; ++step)
        parts[c](model_->columns()[c].shell[k], step) +=
            cost_of(columns_[c], coherence_of_step(step), spectra[c].col(index(k)).squaredNorm(),
                    mode_power.col(index(k)));
  });
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(index(num_shells_), kCoherenceSteps);
  for (const Eigen::MatrixXd& part : parts) sums += part;
  return sums.rowwise().minCoeff().sum();
}

}  // namespace tomofield::align
