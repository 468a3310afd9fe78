#include "tilt_series/masks/bead_tracks.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>

#include "base/threads/parallel.h"

namespace tomofield::tilt_series {
namespace {

// Two views whose tilts differ by this much suggest tracks: they are far enough apart to tell z,
// and near enough for a bead to be in both.
constexpr double kNearestTilt_deg = 8.0, kFarthestTilt_deg = 24.0;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

/// The spots of all views, sorted by y in each, and which of them belong to a track already.
class SpotIndex {
 public:
  explicit SpotIndex(const std::vector<std::vector<Spot>>& spots) : spots_(spots) {
    for (auto& view : spots_) {
      std::stable_sort(view.begin(), view.end(),
                       [](const Spot& a, const Spot& b) { return a.y_px < b.y_px; });
      is_taken_.emplace_back(view.size(), std::uint8_t{0});
    }
  }

  const std::vector<Spot>& of_view(std::size_t view) const { return spots_[view]; }

  std::size_t first_at(std::size_t view, double y) const {
    const auto& of = spots_[view];
    const auto found = std::lower_bound(of.begin(), of.end(), y,
                                        [](const Spot& s, double at) { return s.y_px < at; });
    return static_cast<std::size_t>(found - of.begin());
  }

  /// Returns the nearest free spot within `tolerance` of a place.
  std::optional<std::size_t> nearest(std::size_t view, double x, double y, double tolerance) const {
    std::optional<std::size_t> best;
    double least = tolerance;
    const auto& of = spots_[view];
    for (std::size_t i = first_at(view, y - tolerance);
         i < of.size() && of[i].y_px <= y + tolerance; ++i) {
      const double distance = std::hypot(of[i].x_px - x, of[i].y_px - y);
      if (is_taken_[view][i] || distance > least) continue;
      least = distance;
      best = i;
    }
    return best;
  }

  void take(std::size_t view, std::size_t spot) { is_taken_[view][spot] = 1; }

 private:
  std::vector<std::vector<Spot>> spots_;
  std::vector<std::vector<std::uint8_t>> is_taken_;
};

/// The sums of the least-squares problem x − x0 = x cos θ + z sin θ, y = y.
struct TrackFit {
  double cc = 0, cs = 0, ss = 0, cx = 0, sx = 0, y = 0, n = 0;

  void add(double tilt_rad, double x, double spot_y) {
    const double c = std::cos(tilt_rad), s = std::sin(tilt_rad);
    cc += c * c, cs += c * s, ss += s * s, cx += c * x, sx += s * x, y += spot_y, n += 1;
  }

  /// Returns the solution; nothing if the views are too alike.
  std::optional<BeadTrack> solve() const {
    const double determinant = cc * ss - cs * cs;
    if (!(determinant > 1e-6 * n)) return std::nullopt;
    BeadTrack track;
    track.x_px = (cx * ss - sx * cs) / determinant;
    track.z_px = (sx * cc - cx * cs) / determinant;
    track.y_px = y / n;
    return track;
  }
};

class TrackFinder {
 public:
  TrackFinder(const std::vector<std::vector<Spot>>& spots, const TrackedViews& views,
              const TrackRules& rules)
      : index_(spots), views_(views), rules_(rules) {}

  std::vector<BeadTrack> find() {
    std::vector<BeadTrack> candidates = suggest();
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const BeadTrack& a, const BeadTrack& b) { return a.num_found > b.num_found; });
    std::vector<BeadTrack> tracks;
    for (const BeadTrack& candidate : candidates) {
      const auto track = refine(candidate);
      if (!track || !stands(*track)) continue;
      for (std::size_t view = 0; view < views_.tilt_deg.size(); ++view) {
        if (const auto spot = spot_of(*track, view)) index_.take(view, *spot);
      }
      tracks.push_back(*track);
    }
    return tracks;
  }

 private:
  bool is_strong(const Spot& spot) const { return spot.strength >= rules_.seed_strength; }

  bool stands(const BeadTrack& track) const {
    return track.num_found >= rules_.min_views && std::fabs(track.z_px) <= rules_.max_z_px &&
           static_cast<double>(track.num_found) >=
               rules_.min_part_of_visible * static_cast<double>(track.num_visible);
  }

  std::optional<std::size_t> spot_of(const BeadTrack& track, std::size_t view) const {
    return index_.nearest(view, track_x(track, views_.middle_x_px, views_.tilt_deg[view]),
                          track.y_px, rules_.tolerance_px);
  }

  void count(BeadTrack* track) const {
    track->num_visible = track->num_found = track->num_strong = 0;
    for (std::size_t view = 0; view < views_.tilt_deg.size(); ++view) {
      const double x = track_x(*track, views_.middle_x_px, views_.tilt_deg[view]);
      const auto spot = spot_of(*track, view);
      track->num_found += spot.has_value();
      track->num_strong += spot && is_strong(index_.of_view(view)[*spot]);
      track->num_visible += spot || views_.is_measured(view, x, track->y_px);
    }
  }

  /// Repeats least squares over the spots along the track until these no longer change.
  std::optional<BeadTrack> refine(BeadTrack track) const {
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      TrackFit fit;
      for (std::size_t view = 0; view < views_.tilt_deg.size(); ++view) {
        const auto at = spot_of(track, view);
        if (!at) continue;
        const Spot& spot = index_.of_view(view)[*at];
        fit.add(radians(views_.tilt_deg[view]), spot.x_px - views_.middle_x_px, spot.y_px);
      }
      const auto solved = fit.solve();
      if (!solved) return std::nullopt;
      track = *solved;
    }
    count(&track);
    return track;
  }

  /// Returns the places that two strong spots fix and that other views support.
  std::vector<BeadTrack> suggest() const {
    const std::size_t num_views = views_.tilt_deg.size();
    std::vector<std::vector<BeadTrack>> from_view(num_views);
    base::parallel_for("suggest tracks", std::ssize(from_view), [&](std::int64_t v) {
      const auto first = static_cast<std::size_t>(v);
      for (std::size_t second = 0; second < num_views; ++second) {
        const double apart = views_.tilt_deg[second] - views_.tilt_deg[first];
        if (apart < kNearestTilt_deg || apart > kFarthestTilt_deg) continue;
        suggest_from(first, second, &from_view[first]);
      }
    });
    std::vector<BeadTrack> candidates;
    for (const auto& some : from_view)
      candidates.insert(candidates.end(), some.begin(), some.end());
    return candidates;
  }

  void suggest_from(std::size_t first, std::size_t second,
                    std::vector<BeadTrack>* candidates) const {
    const auto& others = index_.of_view(second);
    for (const Spot& a : index_.of_view(first)) {
      if (!is_strong(a)) continue;
      for (std::size_t i = index_.first_at(second, a.y_px - rules_.tolerance_px);
           i < others.size() && others[i].y_px <= a.y_px + rules_.tolerance_px; ++i) {
        if (!is_strong(others[i])) continue;
        TrackFit fit;
        fit.add(radians(views_.tilt_deg[first]), a.x_px - views_.middle_x_px, a.y_px);
        fit.add(radians(views_.tilt_deg[second]), others[i].x_px - views_.middle_x_px,
                others[i].y_px);
        auto track = fit.solve();
        if (!track || std::fabs(track->z_px) > rules_.max_z_px) continue;
        count(&*track);
        if (track->num_found >= std::min<std::size_t>(3, rules_.min_views)) {
          candidates->push_back(*track);
        }
      }
    }
  }

  SpotIndex index_;
  const TrackedViews& views_;
  const TrackRules& rules_;
};

}  // namespace

double track_x(const BeadTrack& track, double middle_x_px, double tilt_deg) {
  const double tilt = radians(tilt_deg);
  return middle_x_px + track.x_px * std::cos(tilt) + track.z_px * std::sin(tilt);
}

std::vector<BeadTrack> find_tracks(const std::vector<std::vector<Spot>>& spots,
                                   const TrackedViews& views, const TrackRules& rules) {
  return TrackFinder(spots, views, rules).find();
}

}  // namespace tomofield::tilt_series
