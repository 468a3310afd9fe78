#include "verdict/ring_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "base/threads/parallel.h"
#include "fourier/image_transform.h"

namespace tomofield::verdict {
namespace {

constexpr int kFewestSpectra = 5, kFewestPixels = 32;
constexpr int kFirstShell = 4;  // below it, the window and large structures decide
constexpr int kDegree = 5;      // of the polynomial that stands for what is no ring
constexpr int kFactors = 101;
constexpr double kLargestFactor = 1.65;

double factor_of(int index) { return std::pow(kLargestFactor, 2.0 * index / (kFactors - 1) - 1.0); }

// Returns a view under a window that falls to 0 at its sides, without its mean.
fourier::ImageTransform::Image under_window(const evaluate::Image& view) {
  double sum = 0, count = 0;
  for (const float value : view.values) {
    if (!std::isfinite(value)) continue;
    sum += static_cast<double>(value);
    count += 1;
  }
  const double mean = count > 0 ? sum / count : 0.0;
  const auto hann = [](std::int64_t i, std::int64_t n) {
    return 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) /
                                static_cast<double>(n));
  };
  fourier::ImageTransform::Image image(view.values.size());
  for (std::int64_t y = 0; y < view.height; ++y)
    for (std::int64_t x = 0; x < view.width; ++x) {
      const auto i = static_cast<std::size_t>(y * view.width + x);
      if (std::isfinite(view.values[i]))
        image[i] = static_cast<float>((static_cast<double>(view.values[i]) - mean) *
                                      hann(x, view.width) * hann(y, view.height));
    }
  return image;
}

// Returns the number of shells of frequency, which are as wide as the coarser step of a transform.
std::int64_t num_shells(const evaluate::Image& view) {
  return std::min(view.width, view.height) / 2;
}

// Returns the logarithm of the mean power in each shell that counts.
Eigen::VectorXd log_spectrum(const evaluate::Image& view) {
  const fourier::ImageTransform transform(view.width, view.height);
  fourier::ImageTransform::Image image = under_window(view);
  transform.forward(image);
  const std::int64_t shells = num_shells(view);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(shells), count = Eigen::VectorXd::Zero(shells);
  for (std::int64_t y = 0; y < view.height; ++y)
    for (std::int64_t x = 0; x < view.width; ++x) {
      const double k = std::hypot(fourier::cycles_per_pixel(x, view.width),
                                  fourier::cycles_per_pixel(y, view.height));
      const auto shell = std::llround(2 * k * static_cast<double>(shells));
      if (shell >= shells) continue;
      power(shell) +=
          static_cast<double>(std::norm(image[static_cast<std::size_t>(y * view.width + x)]));
      count(shell) += 1;
    }
  const Eigen::Index counted = shells - kFirstShell;
  return (power.tail(counted).array() / count.tail(counted).array() + 1e-30).log();
}

microscope::Ctf transfer_without_envelope(const microscope::ViewTransfer& transfer, double factor) {
  microscope::Optics optics = transfer.optics;
  optics.b_factor_A2 = 0.0;
  io::Defocus defocus = transfer.defocus;
  defocus.u_A = defocus.v_A = factor * (transfer.defocus.u_A + transfer.defocus.v_A) / 2;
  return {optics, defocus};
}

// Returns the square of the transfer in each shell that counts.
Eigen::VectorXd squared_transfer(const microscope::ViewTransfer& transfer, double factor,
                                 std::int64_t shells) {
  const microscope::Ctf ctf = transfer_without_envelope(transfer, factor);
  Eigen::VectorXd squares(shells - kFirstShell);
  for (Eigen::Index i = 0; i < squares.size(); ++i)
    squares(i) = std::pow(ctf.value(static_cast<double>(i + kFirstShell) /
                                        (2 * static_cast<double>(shells) * transfer.pixel_size_A),
                                    0.0),
                          2);
  return squares;
}

// Returns orthonormal polynomials of the frequency, a column each.
Eigen::MatrixXd polynomials(Eigen::Index size) {
  Eigen::MatrixXd powers(size, kDegree + 1);
  for (Eigen::Index i = 0; i < size; ++i)
    for (int degree = 0; degree <= kDegree; ++degree)
      powers(i, degree) =
          std::pow(2.0 * static_cast<double>(i) / static_cast<double>(size) - 1.0, degree);
  return Eigen::HouseholderQR<Eigen::MatrixXd>(powers).householderQ() *
         Eigen::MatrixXd::Identity(size, kDegree + 1);
}

// Returns the correlations of a view's spectrum with the transfers of all factors.
Eigen::VectorXd agreements_of(const evaluate::Image& view,
                              const microscope::ViewTransfer& transfer) {
  const std::int64_t shells = num_shells(view);
  const Eigen::MatrixXd smooth = polynomials(shells - kFirstShell);
  const auto without_smooth = [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
    return (values - smooth * (smooth.transpose() * values)).normalized();
  };
  const Eigen::VectorXd spectrum = without_smooth(log_spectrum(view));
  Eigen::VectorXd found(kFactors);
  for (int i = 0; i < kFactors; ++i)
    found(i) = spectrum.dot(without_smooth(squared_transfer(transfer, factor_of(i), shells)));
  return found;
}

double rings_of(const microscope::ViewTransfer& transfer) {
  const microscope::Ctf ctf = transfer_without_envelope(transfer, 1.0);
  return 2 * ctf.turns(0.5 / transfer.pixel_size_A, 0.0);
}

}  // namespace

std::optional<RingCheck> check_rings(const std::vector<evaluate::Image>& views,
                                     const std::vector<microscope::ViewTransfer>& transfers) {
  std::vector<std::size_t> checked;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (transfers[i].defocus.u_A != 0.0 &&
        std::min(views[i].width, views[i].height) >= kFewestPixels)
      checked.push_back(i);
  if (std::ssize(checked) < kFewestSpectra) return std::nullopt;
  Eigen::MatrixXd agreement(kFactors, std::ssize(checked));  // [factor, view]
  base::parallel_for("check rings", std::ssize(checked), [&](std::int64_t i) {
    const std::size_t view = checked[static_cast<std::size_t>(i)];
    agreement.col(i) = agreements_of(views[view], transfers[view]);
  });
  const Eigen::VectorXd mean = agreement.rowwise().mean();
  Eigen::Index best = 0;
  RingCheck check;
  check.agreement = mean.maxCoeff(&best);
  check.factor = factor_of(static_cast<int>(best));
  check.given = mean(kFactors / 2);
  const Eigen::VectorXd gain = (agreement.row(best) - agreement.row(kFactors / 2)).transpose();
  const auto count = static_cast<double>(gain.size());
  check.standard_error =
      std::sqrt((gain.array() - gain.mean()).square().sum() / (count * (count - 1)));
  for (const std::size_t view : checked) check.rings += rings_of(transfers[view]) / count;
  return check;
}

}  // namespace tomofield::verdict
