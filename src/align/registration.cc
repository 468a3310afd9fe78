#include "align/registration.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "align/blur.h"

namespace tomofield::alignment {
namespace {

constexpr double kRadian_deg = 180.0 / std::numbers::pi;
constexpr std::int64_t kBlock = 16;  // side of a block of the chessboard, in pixels of the stage
// The first solution only says which residuals are large, so every third row is enough for it.
constexpr std::int64_t kRowsOfFirst = 3;

// Returns scale and offset of the line measured = scale · predicted + offset.
std::array<double, 2> fit_line(std::span<const float> predicted, std::span<const float> measured) {
  double n = 0, p = 0, b = 0, pp = 0, pb = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    if (std::isnan(measured[i])) continue;
    const double x = static_cast<double>(predicted[i]), y = static_cast<double>(measured[i]);
    n += 1, p += x, b += y, pp += x * x, pb += x * y;
  }
  const double variance = n * pp - p * p;
  const double scale = variance > 0 ? (n * pb - p * b) / variance : 0.0;
  return {scale, n > 0 ? (b - scale * p) / n : 0.0};
}

// Returns the measured image with the prediction where there is no measurement. So the border of a
// mask pulls nowhere.
std::vector<float> filled(std::span<const float> measured, std::span<const float> predicted) {
  const auto [scale, offset] = fit_line(predicted, measured);
  std::vector<float> image(measured.begin(), measured.end());
  for (std::size_t i = 0; i < image.size(); ++i)
    if (std::isnan(image[i]))
      image[i] = static_cast<float>(scale * static_cast<double>(predicted[i]) + offset);
  return image;
}

// Returns which pixels have only measurements at most `reach` pixels away from them.
std::vector<std::uint8_t> inner_pixels(std::span<const float> measured, std::int64_t width,
                                       std::int64_t reach) {
  const std::int64_t height = std::ssize(measured) / width;
  std::vector<std::uint8_t> of_rows(measured.size(), 1), inner(measured.size(), 1);
  for (std::int64_t y = 0; y < height; ++y) {
    std::int64_t last = -1;  // x of the last pixel that is no measurement; the border is none
    for (std::int64_t x = 0; x < width + reach; ++x) {
      if (x >= width || std::isnan(measured[static_cast<std::size_t>(y * width + x)])) {
        for (std::int64_t i = std::max({std::int64_t{0}, x - reach, last}); i < std::min(x, width);
             ++i)
          of_rows[static_cast<std::size_t>(y * width + i)] = 0;
        last = x;
      }
      if (x < width && x - last <= reach) of_rows[static_cast<std::size_t>(y * width + x)] = 0;
    }
  }
  for (std::int64_t x = 0; x < width; ++x) {
    for (std::int64_t y = 0; y < height; ++y) {
      for (std::int64_t i = y - reach; i <= y + reach; ++i) {
        const bool is_outside = i < 0 || i >= height;
        if (is_outside || of_rows[static_cast<std::size_t>(i * width + x)] == 0)
          inner[static_cast<std::size_t>(y * width + x)] = 0;
      }
    }
  }
  return inner;
}

}  // namespace

// Holds the images in the form in which they are compared.
struct Registration::Prepared {
  Prepared(const ImagePair& images, double blur_px)
      : width(images.width),
        height(images.height),
        centre_x(images.centre_x),
        centre_y(images.centre_y),
        measured(gaussian_blur(filled(images.measured, images.predicted), width, blur_px)),
        predicted(gaussian_blur(images.predicted, width, blur_px)),
        counts(inner_pixels(images.measured, width,
                            static_cast<std::int64_t>(std::ceil(2 * blur_px)) + 1)) {
    if (!images.by_tilt.empty()) by_tilt = gaussian_blur(images.by_tilt, width, blur_px);
  }
  std::int64_t width, height;
  double centre_x, centre_y;
  std::vector<float> measured, predicted, by_tilt;
  std::vector<std::uint8_t> counts;
};

// Gathers rows, since the products of many are faster to add up than those of one.
class Registration::RowBatch {
 public:
  // Adds a row, and its products to `sums` when there are enough.
  void add(const Row& row, double weight, Sums& sums) {
    rows_.col(count_) = row;
    weighted_.col(count_) = weight * row;
    if (++count_ == kRows) add_up(sums);
  }

  // Adds the products of the rows to `sums` and empties the rows.
  void add_up(Sums& sums) {
    sums.noalias() += weighted_.leftCols(count_) * rows_.leftCols(count_).transpose();
    count_ = 0;
  }

 private:
  static constexpr Eigen::Index kRows = 128;
  Eigen::Matrix<double, kColumns, kRows> rows_, weighted_;
  Eigen::Index count_ = 0;
};

double pixels_per_sample(double blur_px) {
  return std::max(1.0, 4 * std::numbers::pi * blur_px * blur_px);
}

Registration::Registration(const ImagePair& images, const RegistrationOptions& options,
                           LocalRegistration* local)
    : options_(options),
      pixel_(images.pixel),
      half_size_(static_cast<double>(std::max(images.width, images.height)) / 2),
      knows_tilt_(!images.by_tilt.empty()),
      pixels_per_sample_(pixels_per_sample(options.blur_px)) {
  const Prepared prepared(images, options.blur_px);
  add_up(prepared, nullptr, nullptr);
  if (num_pixels() == 0) return;
  const Solution first = solve_on(all(), {});
  add_up(prepared, &first, local);
  noise_variance_ = residual_variance({});
  scale_ = scale_of(solve_on(all(), {}));
}

Registration::Row Registration::row_of(const Prepared& images, std::int64_t x,
                                       std::int64_t y) const {
  const auto at = static_cast<std::size_t>(y * images.width + x);
  const auto line = static_cast<std::size_t>(images.width);
  const auto difference = [&](std::size_t step) {
    return 0.5 * (static_cast<double>(images.predicted[at + step]) -
                  static_cast<double>(images.predicted[at - step]));
  };
  const double by_x = difference(1), by_y = difference(line);
  const double qx = (static_cast<double>(x) + 0.5 - images.centre_x) / half_size_;
  const double qy = (static_cast<double>(y) + 0.5 - images.centre_y) / half_size_;
  Row row;
  row[kX] = by_x;
  row[kY] = by_y;
  row[kRotation] = qx * by_y - qy * by_x;
  row[kMagnification] = qx * by_x + qy * by_y;
  row[kTilt] = images.by_tilt.empty() ? 0.0 : static_cast<double>(images.by_tilt[at]);
  row[kScale] = static_cast<double>(images.predicted[at]);
  row.segment<6>(kTrend) << 1.0, qx, qy, qx * qx, qx * qy, qy * qy;
  row[kMeasured] = static_cast<double>(images.measured[at]);
  return row;
}

// Adds up the products of all columns. With a solution, residuals larger than three standard
// deviations count less (Huber 1964).
void Registration::add_up(const Prepared& images, const Solution* last, LocalRegistration* local) {
  double limit = 0.0;
  if (last != nullptr) {
    const double variance = squared_residual(all(), *last) /
                            static_cast<double>(std::max<std::int64_t>(num_pixels(), 1));
    limit = 3.0 * std::sqrt(std::max(variance, 0.0));
  }
  for (Sums& sums : sums_) sums.setZero();
  num_pixels_ = {};
  std::array<RowBatch, 2> batches;  // of each set
  for (std::int64_t y = 0; y < images.height; y += last == nullptr ? kRowsOfFirst : 1) {
    for (std::int64_t x = 0; x < images.width; ++x) {
      if (images.counts[static_cast<std::size_t>(y * images.width + x)] == 0) continue;
      const Row row = row_of(images, x, y);
      double weight = 1.0;
      if (last != nullptr) {
        double residual = row[kMeasured];
        for (std::size_t i = 0; i < last->columns.size(); ++i)
          residual -= last->values[static_cast<Eigen::Index>(i)] * row[last->columns[i]];
        if (std::abs(residual) > limit) weight = limit / std::abs(residual);
      }
      const auto set = static_cast<std::size_t>((x / kBlock + y / kBlock) % 2);
      batches[set].add(row, weight, sums_[set]);
      ++num_pixels_[set];
      if (local != nullptr)
        local->add(set, static_cast<double>(x) + 0.5 - images.centre_x,
                   {row[kX], row[kY], row[kScale], row[kMeasured]}, weight);
    }
    if (local != nullptr) local->end_row(static_cast<double>(y) + 0.5 - images.centre_y);
  }
  for (std::size_t set = 0; set < sums_.size(); ++set) batches[set].add_up(sums_[set]);
}

std::int64_t Registration::num_pixels() const { return num_pixels_[0] + num_pixels_[1]; }

// Returns what a column's prior adds to the normal equations: the variance of the noise of an
// independent sample over that of the column's coefficient.
double Registration::ridge(int column) const {
  double expected = 0.0;
  if (column == kRotation) expected = options_.rotation_prior_deg / kRadian_deg * half_size_;
  if (column == kMagnification) expected = options_.magnification_prior * half_size_;
  if (column == kTilt) expected = options_.tilt_prior_deg;
  expected *= scale_;
  return expected > 0.0 ? noise_variance_ * pixels_per_sample_ / (expected * expected) : 0.0;
}

Registration::Solution Registration::solve_on(const Sums& sums, const Freedoms& freedoms) const {
  Solution solution;
  if (freedoms.shift) solution.columns = {kX, kY};
  if (freedoms.rotation) solution.columns.push_back(kRotation);
  if (freedoms.magnification) solution.columns.push_back(kMagnification);
  if (freedoms.tilt && knows_tilt_) solution.columns.push_back(kTilt);
  for (int column = kScale; column < kMeasured; ++column) solution.columns.push_back(column);
  const auto n = std::ssize(solution.columns);
  Eigen::MatrixXd normal(n, n);
  Eigen::VectorXd right(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const int of_row = solution.columns[static_cast<std::size_t>(i)];
    right[i] = sums(of_row, kMeasured);
    for (Eigen::Index j = 0; j < n; ++j)
      normal(i, j) = sums(of_row, solution.columns[static_cast<std::size_t>(j)]);
    normal(i, i) *= 1.0 + 1e-9;
    normal(i, i) += ridge(of_row) + 1e-30;
  }
  const Eigen::LDLT<Eigen::MatrixXd> factors(normal);
  solution.values = factors.solve(right);
  solution.covariance = factors.solve(Eigen::MatrixXd::Identity(n, n));
  return solution;
}

double Registration::squared_residual(const Sums& sums, const Solution& solution) const {
  double result = sums(kMeasured, kMeasured);
  for (std::size_t i = 0; i < solution.columns.size(); ++i) {
    const double value = solution.values[static_cast<Eigen::Index>(i)];
    result -= 2 * value * sums(solution.columns[i], kMeasured);
    for (std::size_t j = 0; j < solution.columns.size(); ++j)
      result += value * solution.values[static_cast<Eigen::Index>(j)] *
                sums(solution.columns[i], solution.columns[j]);
  }
  return result;
}

double Registration::residual_variance(const Freedoms& freedoms) const {
  return squared_residual(all(), solve_on(all(), freedoms)) / static_cast<double>(num_pixels());
}

double Registration::scale_of(const Solution& solution) {
  const auto at = std::ranges::find(solution.columns, int{kScale}) - solution.columns.begin();
  return solution.values[at];
}

geometry::ViewCorrection Registration::solve(const Freedoms& freedoms) const {
  geometry::ViewCorrection correction;
  const Solution solution = solve_on(all(), freedoms);
  const double num_samples = static_cast<double>(num_pixels()) / pixels_per_sample_;
  if (num_samples < static_cast<double>(solution.columns.size())) return correction;
  const double scale = scale_of(solution);
  if (!(scale > 0.0)) return correction;
  // The view shows at q what the prediction has at q + ε(q), so the view is to be moved by −ε.
  for (std::size_t i = 0; i < solution.columns.size(); ++i) {
    const double value = -solution.values[static_cast<Eigen::Index>(i)] / scale;
    switch (solution.columns[i]) {
      case kX:
        correction.shift_x_px = value * pixel_;
        break;
      case kY:
        correction.shift_y_px = value * pixel_;
        break;
      case kRotation:
        correction.rotation_rad = value / half_size_;
        break;
      case kMagnification:
        correction.log_magnification = value / half_size_;
        break;
      case kTilt:
        correction.tilt_deg = -value;
        break;
      default:
        break;
    }
  }
  return correction;
}

std::array<double, 2> Registration::shift_error(const Freedoms& freedoms) const {
  if (num_pixels() == 0) return {};
  const Solution solution = solve_on(all(), freedoms);
  const double scale = scale_of(solution);
  if (!(scale > 0.0)) return {};
  const double variance = residual_variance(freedoms) * pixels_per_sample_ / (scale * scale);
  return {pixel_ * std::sqrt(variance * solution.covariance(0, 0)),
          pixel_ * std::sqrt(variance * solution.covariance(1, 1))};
}

double Registration::predicted_error(const Freedoms& freedoms) const {
  if (num_pixels_[0] == 0 || num_pixels_[1] == 0) return 0.0;
  double squares = 0.0;
  for (std::size_t set = 0; set < 2; ++set)
    squares += squared_residual(sums_[1 - set], solve_on(sums_[set], freedoms));
  return squares / static_cast<double>(num_pixels());
}

// Returns the sum of the products of two columns of which quadratic trends are subtracted.
double Registration::without_trends(int a, int b) const {
  const Sums sums = all();
  const Eigen::Matrix<double, 6, 6> trends = sums.block<6, 6>(kTrend, kTrend);
  const Eigen::Matrix<double, 6, 1> of_a = sums.block<6, 1>(kTrend, a);
  const Eigen::Matrix<double, 6, 1> of_b = sums.block<6, 1>(kTrend, b);
  return sums(a, b) - of_a.dot(trends.ldlt().solve(of_b));
}

double Registration::measured_variance() const {
  return without_trends(kMeasured, kMeasured) /
         static_cast<double>(std::max<std::int64_t>(num_pixels(), 1));
}

double Registration::correlation() const {
  if (num_pixels() == 0) return 0.0;
  const double variances = without_trends(kScale, kScale) * without_trends(kMeasured, kMeasured);
  return variances > 0.0 ? without_trends(kScale, kMeasured) / std::sqrt(variances) : 0.0;
}

}  // namespace tomofield::alignment
