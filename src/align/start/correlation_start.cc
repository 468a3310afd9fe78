#include "align/start/correlation_start.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <numeric>

#include <Eigen/Cholesky>

#include "align/start/shift_search.h"
#include "align/start/slab_model.h"
#include "align/start/stretched_view.h"
#include "base/check.h"
#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "fourier/image_transform.h"

namespace tomofield::alignment {
namespace {

using fourier::cycles_per_pixel;
using fourier::fast_even_size;
using Image = ImageTransform::Image;
using tilt_series::MaskedImage;

constexpr double kTrend = 0.08;     // σ of the local mean that is removed, a share of the width
constexpr double kTaper = 0.15;     // of the size, at each edge
constexpr double kNoise = 0.3;      // power of the noise over that of the signal, in predictions
constexpr std::size_t kOthers = 8;  // views that predict another one
constexpr int kPasses = 2;          // over all views, after their first shifts are known
// The low pass of IMOD's tiltxcorr, cycles a pixel.
constexpr double kCutoff = 0.25, kFalloff = 0.05;

// Returns a window of a line: 1 in the middle, with the rise of a cosine at both ends.
std::vector<float> taper(std::int64_t size) {
  std::vector<float> window;
  const double rise = kTaper * static_cast<double>(size);
  for (std::int64_t i = 0; i < size; ++i) {
    const double inside = static_cast<double>(std::min(i, size - 1 - i)) + 0.5;
    const double share = std::min(1.0, inside / rise);
    window.push_back(static_cast<float>(0.5 - 0.5 * std::cos(std::numbers::pi * share)));
  }
  return window;
}

// Multiplies a transform by the low pass and by the root of the frequency, which makes the
// frequencies of a specimen's views count more evenly.
void filter(const ImageTransform& transform, Image& image) {
  for (std::int64_t y = 0; y < transform.height(); ++y)
    for (std::int64_t x = 0; x < transform.width(); ++x) {
      const double f = std::hypot(cycles_per_pixel(x, transform.width()),
                                  cycles_per_pixel(y, transform.height()));
      const double beyond = std::max(0.0, f - kCutoff) / kFalloff;
      image[static_cast<std::size_t>(y * transform.width() + x)] *=
          static_cast<float>(std::exp(-0.5 * beyond * beyond) * std::sqrt(f));
    }
}

// Holds the views with their present poses, and improves their shifts.
class PoseSearch {
 public:
  PoseSearch(std::span<const CoarseView> views, const CorrelationOptions& options)
      : options_(options),
        width_(fast_even_size(views.front().image.width)),
        height_(fast_even_size(views.front().image.height)),
        transform_(width_, height_),
        wide_transform_(2 * width_, 2 * height_),
        taper_x_(taper(width_)),
        taper_y_(taper(height_)),
        images_(views.size()),
        poses_(views.size()),
        confidence_(views.size()) {
    base::parallel_for("remove trends", std::ssize(views), [&](std::int64_t i) {
      const CoarseView& view = views[static_cast<std::size_t>(i)];
      images_[static_cast<std::size_t>(i)] =
          without_trend(view.image, kTrend * static_cast<double>(view.image.width));
      poses_[static_cast<std::size_t>(i)].tilt_deg = view.tilt_deg;
    });
  }

  // Finds the shift of each view from views of lower tilt.
  void go_outwards() {
    std::vector<std::size_t> order(poses_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return std::abs(poses_[a].tilt_deg) < std::abs(poses_[b].tilt_deg);
    });
    for (std::size_t i = 1; i < order.size(); ++i) {
      const auto others = nearest(order[i], std::span(order).first(i));
      move(order[i], find(order[i], others));
    }
    first_ = order.front();
  }

  // Finds the shift of each view again, from its neighbours on both sides.
  void compare_with_neighbours() {
    std::vector<std::size_t> all(poses_.size());
    std::iota(all.begin(), all.end(), 0);
    std::vector<FoundShift> found(poses_.size());
    base::parallel_for("compare with neighbours", std::ssize(poses_), [&](std::int64_t i) {
      const auto view = static_cast<std::size_t>(i);
      found[view] = find(view, nearest(view, all));
    });
    for (const std::size_t view : all) move(view, found[view]);
  }

  CorrelationStart result() const {
    CorrelationStart start{{}, confidence_};
    const std::array<double, 2> origin = poses_[first_].shift_px;
    for (const ViewPose& pose : poses_) {
      // The specimen moves so that it stays at the centre of the first view.
      const double cosine = std::cos(pose.tilt_deg * std::numbers::pi / 180.0) /
                            std::cos(poses_[first_].tilt_deg * std::numbers::pi / 180.0);
      start.shift_px.push_back(
          {pose.shift_px[0] - origin[0] * cosine, pose.shift_px[1] - origin[1]});
    }
    return start;
  }

 private:
  struct FoundShift {
    std::array<double, 2> shift_px{};
    double confidence = 0.0;
  };

  std::vector<std::size_t> nearest(std::size_t view, std::span<const std::size_t> among) const {
    std::vector<std::size_t> others(among.begin(), among.end());
    std::erase(others, view);
    const auto distance = [&](std::size_t other) {
      return std::abs(poses_[other].tilt_deg - poses_[view].tilt_deg);
    };
    std::stable_sort(others.begin(), others.end(),
                     [&](std::size_t a, std::size_t b) { return distance(a) < distance(b); });
    others.resize(std::min(others.size(), kOthers));
    return others;
  }

  // Returns the median of the shifts of some views along each axis. A view whose shift is wrong
  // does not lead the search for others astray.
  std::array<double, 2> median_shift(const std::vector<std::size_t>& views) const {
    std::array<double, 2> median{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      std::vector<double> shifts;
      for (const std::size_t view : views) shifts.push_back(poses_[view].shift_px[axis]);
      median[axis] = base::median(shifts);
    }
    return median;
  }

  float window(std::int64_t x, std::int64_t y) const {
    return taper_x_[static_cast<std::size_t>(x)] * taper_y_[static_cast<std::size_t>(y)];
  }

  // Returns the transform of a view under the window, stretched as a view at another tilt.
  Image spectrum(std::size_t view, double seen_at_deg) const {
    const MaskedImage image =
        stretched_view(images_[view], poses_[view], seen_at_deg, width_, height_);
    Image values(image.values.size());
    for (std::int64_t y = 0; y < height_; ++y)
      for (std::int64_t x = 0; x < width_; ++x)
        values[image.index(x, y)] = window(x, y) * image.values[image.index(x, y)];
    transform_.forward(values);
    return values;
  }

  // Returns the transform of a view as others predict it: at each frequency the mean of a Gaussian
  // process, C_vo (C_oo + noise)⁻¹ times the transforms of the others.
  Image predicted_spectrum(std::size_t view, const std::vector<std::size_t>& others) const {
    const double seen_at = poses_[view].tilt_deg;
    const double cosine = std::cos(seen_at * std::numbers::pi / 180.0);
    std::vector<double> tilts{seen_at};
    std::vector<Image> seen;
    for (const std::size_t other : others) {
      tilts.push_back(poses_[other].tilt_deg);
      seen.push_back(spectrum(other, seen_at));
    }
    const SlabModel model(tilts, options_.thickness_px);
    const auto n = static_cast<Eigen::Index>(others.size());
    Image sum(static_cast<std::size_t>(width_ * height_));
    for (std::int64_t x = 0; x < width_; ++x) {
      const Eigen::MatrixXd alike =
          model.correlation(std::abs(cycles_per_pixel(x, width_)) * cosine);
      const Eigen::MatrixXd covariance =
          alike.bottomRightCorner(n, n) + kNoise * Eigen::MatrixXd::Identity(n, n);
      const Eigen::VectorXd weights = covariance.ldlt().solve(alike.col(0).tail(n));
      for (std::size_t o = 0; o < seen.size(); ++o)
        for (std::int64_t y = 0; y < height_; ++y) {
          const auto at = static_cast<std::size_t>(y * width_ + x);
          sum[at] += static_cast<float>(weights[static_cast<Eigen::Index>(o)]) * seen[o][at];
        }
    }
    return sum;
  }

  // Puts the prediction into the middle of an image of twice the size, so that shifts wrap nowhere.
  Reference predict(std::size_t view, const std::vector<std::size_t>& others) const {
    Image values = predicted_spectrum(view, others);
    filter(transform_, values);
    transform_.inverse(values);
    Reference reference{Image(4 * values.size()), Image(4 * values.size())};
    for (std::int64_t y = 0; y < height_; ++y)
      for (std::int64_t x = 0; x < width_; ++x) {
        const auto at = static_cast<std::size_t>((y + height_ / 2) * 2 * width_ + x + width_ / 2);
        reference.values[at] = values[static_cast<std::size_t>(y * width_ + x)].real();
        reference.weights[at] = window(x, y);
      }
    return reference;
  }

  // Looks for the shift of a view around those of others.
  FoundShift find(std::size_t view, const std::vector<std::size_t>& others) const {
    const ViewPose start{poses_[view].tilt_deg, median_shift(others)};
    MaskedImage image =
        stretched_view(images_[view], start, start.tilt_deg, 2 * width_, 2 * height_);
    Image values(image.values.begin(), image.values.end());
    wide_transform_.forward(values);
    filter(wide_transform_, values);
    wide_transform_.inverse(values);
    for (std::size_t i = 0; i < values.size(); ++i)
      image.values[i] = image.valid[i] ? values[i].real() : 0.0f;
    const ShiftPeak peak =
        find_shift(wide_transform_, predict(view, others), image,
                   {options_.largest_shift * static_cast<double>(images_[view].width),
                    options_.largest_shift * static_cast<double>(images_[view].height)});
    return {{start.shift_px[0] + peak.moved_px[0], start.shift_px[1] + peak.moved_px[1]},
            peak.prominence};
  }

  void move(std::size_t view, const FoundShift& found) {
    poses_[view].shift_px = found.shift_px;
    confidence_[view] = found.confidence;
  }

  CorrelationOptions options_;
  std::int64_t width_, height_;
  ImageTransform transform_, wide_transform_;
  std::vector<float> taper_x_, taper_y_;
  std::vector<MaskedImage> images_;  // without trends
  std::vector<ViewPose> poses_;
  std::vector<double> confidence_;
  std::size_t first_ = 0;  // the view nearest to zero tilt
};

}  // namespace

CorrelationStart correlate_views(std::span<const CoarseView> views,
                                 const CorrelationOptions& options) {
  TOMOFIELD_CHECK(views.size() >= 2, "views to correlate");
  PoseSearch search(views, options);
  search.go_outwards();
  for (int pass = 0; pass < kPasses; ++pass) search.compare_with_neighbours();
  return search.result();
}

}  // namespace tomofield::alignment
