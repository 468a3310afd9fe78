#include "align/correlation_start.h"

#include <kiss_fft.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstdio>
#include <numeric>
#include <numbers>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "align/image_transform.h"
#include "align/shift_search.h"
#include "align/slab_likelihood.h"
#include "align/slab_model.h"
#include "align/stretched_view.h"
#include "base/parallel.h"

namespace tomofield::align {
namespace {

using Image = ImageTransform::Image;
using tilt_series::MaskedImage;

double env(const char* name, double value) {
  const char* text = std::getenv(name);
  return text ? std::atof(text) : value;
}

std::int64_t fast_even_size(std::int64_t size) {
  return 2 * kiss_fft_next_fast_size(static_cast<int>((size + 1) / 2));
}

// Returns 1 in the middle of a line and a cosine's rise at both ends.
std::vector<float> taper(std::int64_t size) {
  std::vector<float> window;
  const double rise = env("TAPER", 0.15) * static_cast<double>(size);
  for (std::int64_t i = 0; i < size; ++i) {
    const double inside = std::min(static_cast<double>(i), static_cast<double>(size - 1 - i)) + 0.5;
    const double t = std::min(1.0, inside / rise);
    window.push_back(static_cast<float>(0.5 - 0.5 * std::cos(std::numbers::pi * t)));
  }
  return window;
}

class Search {
 public:
  Search(std::span<const CoarseView> views, const CorrelationOptions& options)
      : views_(views),
        options_(options),
        width_(fast_even_size(views.front().image.width)),
        height_(fast_even_size(views.front().image.height)),
        transform_(width_, height_),
        wide_(2 * width_, 2 * height_),
        taper_x_(taper(width_)),
        taper_y_(taper(height_)),
        images_(views.size()),
        pose_(views.size()),
        spectrum_(views.size()) {
    base::parallel_for("remove trends", std::ssize(views), [&](std::int64_t v) {
      const auto view = static_cast<std::size_t>(v);
      images_[view] = without_trend(
          views[view].image, env("TREND", 0.1) * static_cast<double>(views[view].image.width));
      pose_[view].tilt_deg = views[view].tilt_deg;
    });
  }

  void look(std::size_t v) {
    const MaskedImage image = stretched_view(images_[v], pose_[v], width_, height_);
    Image values(image.values.size());
    for (std::int64_t y = 0; y < height_; ++y)
      for (std::int64_t x = 0; x < width_; ++x)
        values[image.index(x, y)] = taper_x_[static_cast<std::size_t>(x)] *
                                    taper_y_[static_cast<std::size_t>(y)] *
                                    image.values[image.index(x, y)];
    transform_.forward(values);
    spectrum_[v] = std::move(values);
  }
  void look() {
    base::parallel_for("look", std::ssize(views_),
                       [&](std::int64_t v) { look(static_cast<std::size_t>(v)); });
  }

  double response(double fx, double fy) const {
    const double f = std::hypot(fx, fy);
    static const double lp = env("LP", 0.25), whiten = env("WHITEN", 0.5);
    const double beyond = std::max(0.0, f - lp) / 0.05;
    return std::exp(-0.5 * beyond * beyond) * std::pow(f, whiten);
  }

  void filter(const ImageTransform& t, Image& image) const {
    for (std::int64_t y = 0; y < t.height(); ++y)
      for (std::int64_t x = 0; x < t.width(); ++x)
        image[static_cast<std::size_t>(y * t.width() + x)] *=
            static_cast<float>(response(cycles_per_pixel(x, t.width()), cycles_per_pixel(y, t.height())));
  }

  Reference predict(std::size_t v, std::vector<std::size_t> others) const {
    std::vector<double> tilts{views_[v].tilt_deg};
    for (const std::size_t o : others) tilts.push_back(views_[o].tilt_deg);
    const SlabModel model({}, tilts, options_.thickness_px);
    Image values(static_cast<std::size_t>(width_ * height_));
    const auto n = static_cast<Eigen::Index>(others.size());
    for (std::int64_t x = 0; x < width_; ++x) {
      const double fx = cycles_per_pixel(x, width_);
      const Eigen::MatrixXd c = model.correlation(std::abs(fx));
      static const double lambda = env("LAMBDA", 0.3);
      const Eigen::MatrixXd k =
          c.bottomRightCorner(n, n) + lambda * Eigen::MatrixXd::Identity(n, n);
      const Eigen::VectorXd w = k.ldlt().solve(c.col(0).tail(n));
      for (std::int64_t y = 0; y < height_; ++y) {
        const auto at = static_cast<std::size_t>(y * width_ + x);
        std::complex<double> sum = 0.0;
        for (Eigen::Index i = 0; i < n; ++i)
          sum += w[i] * std::complex<double>(spectrum_[others[static_cast<std::size_t>(i)]][at]);
        values[at] = std::complex<float>(sum);
      }
    }
    filter(transform_, values);
    transform_.inverse(values);
    Reference reference{Image(values.size() * 4), Image(values.size() * 4)};
    for (std::int64_t y = 0; y < height_; ++y)
      for (std::int64_t x = 0; x < width_; ++x) {
        const auto at =
            static_cast<std::size_t>((y + height_ / 2) * 2 * width_ + x + width_ / 2);
        reference.values[at] = values[static_cast<std::size_t>(y * width_ + x)].real();
        reference.weights[at] =
            taper_x_[static_cast<std::size_t>(x)] * taper_y_[static_cast<std::size_t>(y)];
      }
    return reference;
  }

  ShiftPeak find(std::size_t v, const std::vector<std::size_t>& others) const {
    const Reference reference = predict(v, others);
    MaskedImage image = stretched_view(images_[v], pose_[v], 2 * width_, 2 * height_);
    Image values(image.values.begin(), image.values.end());
    wide_.forward(values);
    filter(wide_, values);
    wide_.inverse(values);
    for (std::size_t i = 0; i < values.size(); ++i)
      image.values[i] = image.valid[i] ? values[i].real() : 0.0f;
    const double cosine = std::cos(views_[v].tilt_deg * std::numbers::pi / 180.0);
    const double range = options_.largest_shift * static_cast<double>(views_[v].image.width);
    return find_shift(wide_, reference, image, {range / cosine, range});
  }

  void move(std::size_t v, const std::array<double, 2>& moved) {
    const auto shift = image_shift(pose_[v], moved);
    pose_[v].shift_px[0] += shift[0];
    pose_[v].shift_px[1] += shift[1];
  }

  std::vector<std::size_t> nearest(std::size_t v, const std::vector<std::size_t>& others) const {
    std::vector<std::size_t> sorted = others;
    std::erase(sorted, v);
    std::stable_sort(sorted.begin(), sorted.end(), [&](std::size_t a, std::size_t b) {
      return std::abs(views_[a].tilt_deg - views_[v].tilt_deg) <
             std::abs(views_[b].tilt_deg - views_[v].tilt_deg);
    });
    sorted.resize(std::min<std::size_t>(sorted.size(), static_cast<std::size_t>(env("REFS", 8))));
    return sorted;
  }

  void go_outwards() {
    std::vector<std::size_t> order(views_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return std::abs(views_[a].tilt_deg) < std::abs(views_[b].tilt_deg);
    });
    std::vector<std::size_t> done{order.front()};
    look(order.front());
    for (std::size_t i = 1; i < order.size(); ++i) {
      const std::size_t v = order[i];
      const auto others = nearest(v, done);
      pose_[v].shift_px = pose_[others.front()].shift_px;
      move(v, find(v, others).moved_px);
      look(v);
      done.push_back(v);
    }
  }

  double total_correlation() const {
    std::vector<std::size_t> all(views_.size());
    std::iota(all.begin(), all.end(), 0);
    std::vector<double> parts(views_.size());
    base::parallel_for("check", std::ssize(views_), [&](std::int64_t i) {
      const auto v = static_cast<std::size_t>(i);
      parts[v] = find(v, nearest(v, all)).correlation;
    });
    return std::accumulate(parts.begin(), parts.end(), 0.0);
  }

  void check_all() {
    std::vector<std::size_t> all(views_.size());
    std::iota(all.begin(), all.end(), 0);
    std::vector<ShiftPeak> peaks(views_.size());
    base::parallel_for("check", std::ssize(views_), [&](std::int64_t i) {
      const auto v = static_cast<std::size_t>(i);
      peaks[v] = find(v, nearest(v, all));
    });
    confidence_.clear();
    for (std::size_t v = 0; v < views_.size(); ++v) {
      move(v, peaks[v].moved_px);
      confidence_.push_back(peaks[v].prominence);
      if (std::hypot(peaks[v].moved_px[0], peaks[v].moved_px[1]) > 2)
        std::printf("  jump %zu %.1f %.1f cc %.2f centre %.2f prom %.1f\n", v, peaks[v].moved_px[0], peaks[v].moved_px[1], peaks[v].correlation, peaks[v].at_centre, peaks[v].prominence);
    }
    look();
  }

  Spectra spectra(const SlabModel& model) const {
    Spectra result;
    for (const FrequencyColumn& column : model.columns()) {
      Eigen::MatrixXcd matrix(views_.size(), column.ky.size());
      for (std::size_t v = 0; v < views_.size(); ++v)
        for (std::size_t k = 0; k < column.ky.size(); ++k)
          matrix(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(k)) =
              model.has_signal(v, column.fx)
                  ? std::complex<double>(
                        spectrum_[v][static_cast<std::size_t>(column.ky[k] * width_ + column.kx)])
                  : 0.0;
      result.push_back(std::move(matrix));
    }
    return result;
  }

  double refine(const SlabModel& model, const SlabLikelihood& likelihood, int steps) {
    double cost = 0;
    for (int step = 0; step < steps; ++step) {
      look();
      Spectra z = spectra(model);
      likelihood.normalise(z);
      const auto coherence = likelihood.estimate_coherence(z);
      cost = likelihood.cost(z, coherence);
      const PositionDerivatives d = likelihood.derivatives(z, coherence);
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(d.hessian);
      const Eigen::VectorXd& values = solver.eigenvalues();
      const double floor = env("FLOOR", 1e-4) * values.cwiseAbs().maxCoeff();
      Eigen::VectorXd modes = solver.eigenvectors().transpose() * d.gradient;
      for (Eigen::Index i = 0; i < modes.size(); ++i)
        modes[i] /= std::max(std::abs(values[i]), floor);
      Eigen::VectorXd moved = -(solver.eigenvectors() * modes);
      const double largest = moved.cwiseAbs().maxCoeff();
      const double trust = 1.0;
      if (largest > trust) moved *= trust / largest;
      const auto n = static_cast<Eigen::Index>(views_.size());
      for (Eigen::Index v = 0; v < n; ++v)
        move(static_cast<std::size_t>(v), {moved[v], moved[n + v]});
      if (env("VERBOSE", 0) > 0) {
        std::printf("   step %d cost %.1f largest %.3f neg %ld  c:", step, cost, largest, (long)(values.array() < 0).count());
        for (double c : coherence) std::printf(" %.2f", c);
        std::printf("\n");
      }
      if (largest < 0.01) break;
    }
    look();
    return cost;
  }

  double cost(const SlabModel& model, const SlabLikelihood& likelihood) {
    look();
    Spectra z = spectra(model);
    likelihood.normalise(z);
    return likelihood.cost(z, likelihood.estimate_coherence(z));
  }

  void set_axis(double axis_deg) {
    for (ViewPose& pose : pose_) pose.axis_deg = axis_deg;
  }

  std::span<const CoarseView> views_;
  CorrelationOptions options_;
  std::int64_t width_, height_;
  ImageTransform transform_, wide_;
  std::vector<float> taper_x_, taper_y_;
  std::vector<MaskedImage> images_;
  std::vector<ViewPose> pose_;
  std::vector<Image> spectrum_;
  std::vector<double> confidence_;
};

}  // namespace
void report(const char* what, const std::vector<std::array<double, 2>>& shifts);

CorrelationStart correlate_views(std::span<const CoarseView> views,
                                 const CorrelationOptions& options) {
  Search search(views, options);
  const auto tell = [&](const char* what) {
    std::vector<std::array<double, 2>> s;
    for (const auto& p : search.pose_) s.push_back(p.shift_px);
    report(what, s);
  };
  search.go_outwards();
  tell("outwards");
  for (int i = 0; i < env("CHECKS", 2); ++i) {
    search.check_all();
    tell("check");
  }
  std::vector<double> tilts;
  for (const CoarseView& v : views) tilts.push_back(v.tilt_deg);
  std::vector<FrequencyColumn> ncols;
  for (auto c : frequencies_below(env("LIMIT", 0.35), search.width_, search.height_))
    if (c.fx >= env("NKXMIN", 0)) ncols.push_back(c);
  const SlabModel model(ncols, tilts,
                        options.thickness_px * env("TFACTOR", 1));
  const SlabLikelihood likelihood(model);
  search.refine(model, likelihood, env("STEPS", 10));
  tell("refined");
  if (env("RECHECK", 0) > 0) { search.check_all(); tell("recheck"); }
  if (options.axis_range_deg > 0) {
    std::vector<FrequencyColumn> cols;
    for (auto c : frequencies_below(env("ALIMIT", 0.35), search.width_, search.height_))
      if (c.fx <= env("KXMAX", 1) && c.fx >= env("KXMIN", 0)) cols.push_back(c);
    const SlabModel amodel(cols, tilts, options.thickness_px * env("ATFACTOR", 1));
    const SlabLikelihood alikelihood(amodel);
    auto parabola = [](double l, double m, double r) { double b = l - 2 * m + r; return b > 0 ? std::clamp(0.5 * (l - r) / b, -0.5, 0.5) : 0.0; };
    for (int which = 0; which < 1; ++which) {
    std::vector<double> cs;
    for (double a = -6; a <= 6; a += 1) {
      search.set_axis(a);
      cs.push_back(which == 0 ? search.cost(amodel, alikelihood) : (search.look(), -search.total_correlation()));
    }
    size_t b = std::min_element(cs.begin()+1, cs.end()-1) - cs.begin();
    std::printf("%s axis %.3f\n", which ? "corr" : "like", -6.0 + b + parabola(cs[b - 1], cs[b], cs[b + 1]));
    for (double a: {-0.5, 0.0, 0.5}) { search.set_axis(-6.0+b+parabola(cs[b - 1], cs[b], cs[b + 1])+a); cs.push_back(which == 0 ? search.cost(amodel, alikelihood) : (search.look(), -search.total_correlation())); }
    size_t e = cs.size() - 2;
    std::printf("%s axis refined %.3f\n", which ? "corr" : "like", search.pose_[0].axis_deg-0.5 + 0.5*parabola(cs[e - 1], cs[e], cs[e + 1]));
    }
  }
  if (0) {
    double best = 0, best_cost = 0;
    for (double a = -6; a <= 6; a += 1) {
      search.set_axis(a);
      const double c = search.cost(model, likelihood);
      std::printf("  axis %.1f cost %.1f\n", a, c);
      if (c < best_cost) best_cost = c, best = a;
    }
    search.set_axis(best);
    search.refine(model, likelihood, 5);
    tell("axis 1");
    for (double step : {0.5, 0.25}) {
      const double here = search.pose_[0].axis_deg;
      double c[3];
      for (int i = -1; i <= 1; ++i) {
        search.set_axis(here + i * step);
        c[i + 1] = search.cost(model, likelihood);
      }
      const double bend = c[0] - 2 * c[1] + c[2];
      const double at = bend > 0 ? std::clamp(0.5 * (c[0] - c[2]) / bend, -1.5, 1.5) : 0;
      search.set_axis(here + at * step);
      std::printf("  axis %.3f\n", here + at * step);
      search.refine(model, likelihood, 5);
      tell("axis 2");
    }
  }
  CorrelationStart start;
  start.axis_deg = search.pose_[0].axis_deg;
  for (const auto& p : search.pose_) start.shift_px.push_back(p.shift_px);
  start.confidence = search.confidence_;
  return start;
}

}  // namespace tomofield::align
