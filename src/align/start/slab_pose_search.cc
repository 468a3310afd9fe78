#include "align/start/slab_pose_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "align/blur.h"
#include "base/threads/parallel.h"

namespace tomofield::alignment {
namespace {

// The values of a row of all views are factorised together, which limits their number.
constexpr double kMostValues = 1000, kMostColumns = 16, kFewestColumns = 6;
constexpr double kWidth = 0.6;      // σ of a column's Gaussian, in distances between columns
constexpr double kGrain = 0.6;      // σ of the specimen's correlation, in the same
constexpr double kHighPass = 0.1;   // σ of the trend along y that is removed, a share of the width
constexpr double kNoise = 0.1;      // variance over that of the signal
constexpr Eigen::Index kParts = 8;  // of the rows, whose differences tell the error
constexpr double kNoCount = 1e6;    // variance of values that do not count
// The search fits parabolas through poses that are a step apart, in turn along pitch and thickness.
// The first steps are wider than the others.
constexpr double kFirstStep_deg = 3.0, kStep_deg = 1.5;
constexpr double kFirstFactor = 1.25, kFactor = 1.1;  // between thicknesses
constexpr double kLongestStep = 1.5;                  // of a parabola, in its steps
constexpr double kNear = 0.5;                         // steps are that short at the end
constexpr int kMostRounds = 6;
constexpr double kMostPitch_deg = 12.0, kMostFactor = 2.0;

double radians(double deg) { return deg * std::numbers::pi / 180.0; }

// Returns the part of a normal distribution below x.
double normal_below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

// Returns the integral over |Z| ≤ thickness / 2 of a normal distribution's density at a − t Z.
double integral_of_normal(double a, double t, double sigma, double thickness) {
  if (std::abs(t) * thickness < 1e-3 * sigma) {
    const double at = a / sigma;
    return thickness * std::exp(-0.5 * at * at) / (sigma * std::sqrt(2 * std::numbers::pi));
  }
  const double half = t * thickness / 2;
  return (normal_below((half - a) / sigma) - normal_below((-half - a) / sigma)) / t;
}

// Holds where a parabola is highest, in steps from its middle point, and the standard error of this
// place.
struct Peak {
  double place, error;
};

// Returns the peak of the parabola through three log-likelihoods of each part of the rows, one step
// apart; nothing if their sum has none.
std::optional<Peak> peak_of(const Eigen::VectorXd& left, const Eigen::VectorXd& middle,
                            const Eigen::VectorXd& right) {
  const double bend = 2 * middle.sum() - left.sum() - right.sum();
  if (!(bend > 0.0)) return std::nullopt;
  const Eigen::ArrayXd slopes = 0.5 * (right - left).array();
  const double spread = (slopes - slopes.mean()).square().sum() / (kParts - 1);
  return Peak{slopes.sum() / bend, std::sqrt(spread * kParts) / bend};
}

}  // namespace

SlabPoseSearch::SlabPoseSearch(std::span<const double> tilt_deg, int hand, std::int64_t width,
                               bool is_bounded)
    : tilt_deg_(tilt_deg.begin(), tilt_deg.end()),
      hand_(hand),
      width_(width),
      is_bounded_(is_bounded),
      views_(tilt_deg.size()) {
  const double count = std::clamp(std::floor(kMostValues / static_cast<double>(tilt_deg.size())),
                                  kFewestColumns, kMostColumns);
  const double distance = static_cast<double>(width) / count;
  sigma_px_ = kWidth * distance;
  const double last = static_cast<double>(width) / 2 - 2 * sigma_px_;
  for (double place = distance / 2; place <= last; place += distance) {
    place_.push_back(place);
    place_.push_back(-place);
  }
}

// Returns the columns of an image, in a band of frequencies along y, without the rows that lack
// neighbours.
SlabPoseSearch::Columns SlabPoseSearch::reduce(std::span<const float> image) const {
  const std::int64_t height = std::ssize(image) / width_;
  const Eigen::Map<const Eigen::MatrixXf> pixels(image.data(), width_, height);
  Eigen::MatrixXf weights(std::ssize(place_), width_);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    for (Eigen::Index x = 0; x < width_; ++x) {
      const double off = static_cast<double>(x) + 0.5 - static_cast<double>(width_) / 2 -
                         place_[static_cast<std::size_t>(i)];
      weights(i, x) = static_cast<float>(std::exp(-0.5 * std::pow(off / sigma_px_, 2)));
    }
    weights.row(i) /= weights.row(i).sum();
  }
  const Eigen::MatrixXf columns = weights * pixels;
  const double trend = kHighPass * static_cast<double>(width_);
  const auto border = static_cast<Eigen::Index>(std::ceil(1.5 * trend));
  Columns result(columns.rows(), std::max<Eigen::Index>(0, height - 2 * border));
  for (Eigen::Index i = 0; i < columns.rows(); ++i) {
    const Eigen::VectorXf column = columns.row(i);
    const std::span<const float> values(column.data(), static_cast<std::size_t>(height));
    const std::vector<float> fine = gaussian_blur(values, 1, sigma_px_);
    const std::vector<float> coarse = gaussian_blur(values, 1, trend);
    for (Eigen::Index y = 0; y < result.cols(); ++y) {
      const auto at = static_cast<std::size_t>(y + border);
      result(i, y) = static_cast<double>(fine[at] - coarse[at]);
    }
  }
  return result;
}

void SlabPoseSearch::add(std::size_t view, const ImagePair& images) {
  std::vector<float> image(images.measured.begin(), images.measured.end());
  for (std::size_t i = 0; i < image.size(); ++i)
    if (std::isnan(image[i])) image[i] = images.predicted[i];
  views_[view] = reduce(image);
}

// Says whether the rays at a place of a view leave the specimen through its faces, not at its
// sides.
bool SlabPoseSearch::counts(std::size_t view, double place, double thickness_px) const {
  const double tilt = radians(tilt_deg_[view]);
  const double faces = static_cast<double>(width_) / 2 * std::cos(tilt) -
                       thickness_px / 2 * std::abs(std::sin(tilt));
  return !is_bounded_ || std::abs(place) < faces;
}

// Returns the logarithm of the likelihood of each part of the rows, but for a constant. The
// variance of the values is the likeliest one. `thickness_px` decides which values count, in all
// poses. The middle of the slab is at `height_px` above that of the volume.
Eigen::VectorXd SlabPoseSearch::log_likelihood(const SlabPose& pose, double thickness_px,
                                               double height_px) const {
  const Eigen::Index columns = std::ssize(place_), n = columns * std::ssize(views_);
  const double grain = kGrain / kWidth * sigma_px_;
  const double variance = sigma_px_ * sigma_px_ + grain * grain;
  Eigen::MatrixXd covariance(n, n);
  base::parallel_for("covariance of columns", std::ssize(views_), [&](std::int64_t v) {
    const double at_v = radians(tilt_deg_[static_cast<std::size_t>(v)] + pose.pitch_deg);
    for (std::int64_t w = 0; w <= v; ++w) {
      const double at_w = radians(tilt_deg_[static_cast<std::size_t>(w)] + pose.pitch_deg);
      const double slope = hand_ * (std::tan(at_v) - std::tan(at_w));
      const double cos_v = std::cos(at_v), cos_w = std::cos(at_w);
      const double sigma = std::sqrt(variance * (1 / (cos_v * cos_v) + 1 / (cos_w * cos_w)));
      for (std::int64_t i = 0; i < columns; ++i)
        for (std::int64_t j = 0; j < columns; ++j) {
          const double apart = place_[static_cast<std::size_t>(i)] / cos_v -
                               place_[static_cast<std::size_t>(j)] / cos_w - slope * height_px;
          covariance(v * columns + i, w * columns + j) =
              integral_of_normal(apart, slope, sigma, pose.thickness_px) / (cos_v * cos_w);
        }
    }
  });
  covariance /= covariance.diagonal().mean();
  covariance.diagonal().array() += kNoise;
  for (std::int64_t v = 0; v < std::ssize(views_); ++v)
    for (std::int64_t i = 0; i < columns; ++i)
      if (!counts(static_cast<std::size_t>(v), place_[static_cast<std::size_t>(i)], thickness_px))
        covariance(v * columns + i, v * columns + i) += kNoCount;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(covariance);
  Eigen::MatrixXd values(n, views_.front().cols());
  for (Eigen::Index v = 0; v < std::ssize(views_); ++v)
    values.middleRows(v * columns, columns) = views_[static_cast<std::size_t>(v)];
  factor.matrixL().solveInPlace(values);
  const double mean_square = values.squaredNorm() / static_cast<double>(values.size());
  const double half_log_determinant = covariance.diagonal().array().log().sum();
  const double of_row =
      -half_log_determinant - 0.5 * static_cast<double>(n) * std::log(mean_square);
  Eigen::VectorXd parts = Eigen::VectorXd::Zero(kParts);
  for (Eigen::Index row = 0; row < values.cols(); ++row)
    parts[row * kParts / values.cols()] +=
        of_row - 0.5 * values.col(row).squaredNorm() / mean_square + 0.5 * static_cast<double>(n);
  return parts;
}

// Fits a line through the heights of the parts of the rows. The likelihood of a part over the
// height is a parabola with the mean bend of all parts.
void SlabPoseSearch::find_x_tilt(double thickness_px, FoundPose& found) const {
  const double step_px = sigma_px_;
  const auto at = [&](double height_px) {
    return log_likelihood(found.pose, thickness_px, height_px);
  };
  const Eigen::VectorXd below = at(-step_px), middle = at(0.0), above = at(step_px);
  const double bend = (2 * middle - below - above).mean();
  if (!(bend > 0.0)) return;
  const Eigen::ArrayXd heights_px = 0.5 * step_px / bend * (above - below).array();
  const double rows = static_cast<double>(views_.front().cols());
  const Eigen::ArrayXd places_px =
      ((Eigen::ArrayXd::LinSpaced(kParts, 0.5, kParts - 0.5) / kParts) - 0.5) * rows;
  const double moment = places_px.square().sum();
  const double slope = (places_px * heights_px).sum() / moment;
  const Eigen::ArrayXd rest = heights_px - heights_px.mean() - slope * places_px;
  const double variance = rest.square().sum() / (kParts - 2);
  found.pose.x_tilt_deg = -hand_ * std::atan(slope) * 180.0 / std::numbers::pi;
  found.error.x_tilt_deg = std::sqrt(variance / moment) * 180.0 / std::numbers::pi;
}

std::optional<FoundPose> SlabPoseSearch::find(const SlabPose& start,
                                              const std::optional<FoundPitch>& known) const {
  if (views_.front().cols() < 2 * kParts) return std::nullopt;
  SlabPose best = start;
  if (known) best.pitch_deg = known->deg;
  const auto pitch_near = [&](double step_deg) -> std::optional<Peak> {
    if (known) return Peak{0.0, known->error_deg / step_deg};
    const auto at = [&](double deg) {
      return log_likelihood({best.thickness_px, best.pitch_deg + deg}, start.thickness_px);
    };
    return peak_of(at(-step_deg), at(0.0), at(step_deg));
  };
  const auto thickness_near = [&](double factor) {
    const auto at = [&](double part) {
      return log_likelihood({best.thickness_px * part, best.pitch_deg}, start.thickness_px);
    };
    return peak_of(at(1 / factor), at(1.0), at(factor));
  };
  FoundPose found;
  bool is_near = false;  // the last steps were short
  for (int round = 0; round < kMostRounds && !is_near; ++round) {
    const double step_deg = round == 0 ? kFirstStep_deg : kStep_deg;
    const double factor = round == 0 ? kFirstFactor : kFactor;
    const auto pitch = pitch_near(step_deg);
    if (!pitch) return std::nullopt;
    best.pitch_deg += step_deg * std::clamp(pitch->place, -kLongestStep, kLongestStep);
    const auto thickness = thickness_near(factor);
    if (!thickness) return std::nullopt;
    best.thickness_px *=
        std::pow(factor, std::clamp(thickness->place, -kLongestStep, kLongestStep));
    found = {best,
             {.thickness_px = best.thickness_px * std::log(factor) * thickness->error,
              .pitch_deg = step_deg * pitch->error}};
    is_near = round > 0 && std::abs(pitch->place) < kNear && std::abs(thickness->place) < kNear;
  }
  const double change = best.thickness_px / start.thickness_px;
  const bool is_inside = change < kMostFactor && change > 1 / kMostFactor &&
                         (known || std::abs(best.pitch_deg - start.pitch_deg) < kMostPitch_deg);
  if (!is_near || !is_inside) return std::nullopt;
  find_x_tilt(start.thickness_px, found);
  return found;
}

}  // namespace tomofield::alignment
