#include "tilt_series/beads.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "tilt_series/bead_profile.h"
#include "tilt_series/bead_tracks.h"
#include "tilt_series/spots.h"

namespace tomofield::tilt_series {
namespace {

// Strengths of spots. Structure reaches 5 in the series that we know (simulated
// cells, dark-field films and particles), beads in vitreous ice 6 to 20.
constexpr double kStrong = 6.0;
constexpr double kLikely = 4.5;  // enough for a seed once it is known that there are beads
constexpr double kWeak = 3.5;    // enough where a track says that a bead is there

constexpr std::size_t kDiameterViews = 5;  // the lowest tilts, which the diameter is measured in
constexpr double kDiameterStep = 1.4142135623730951;  // between the diameters that are tried

// Clear evidence: this many beads, each with spots in this part of all views.
constexpr std::size_t kFewestBeads = 3;
constexpr double kPartOfViews = 0.5;

// A spot without a track is a bead's if it has this part of their median contrast in its view.
constexpr double kPartOfContrast = 0.5;

/// Spots of every view, and which of its pixels were measured.
struct SearchedViews {
  std::vector<std::vector<Spot>> spots;
  std::vector<std::vector<bool>> is_valid;
  std::int64_t width = 0, height = 0;

  bool is_measured(std::size_t view, double x, double y) const {
    const auto px = static_cast<std::int64_t>(std::floor(x)),
               py = static_cast<std::int64_t>(std::floor(y));
    return px >= 0 && px < width && py >= 0 && py < height &&
           is_valid[view][static_cast<std::size_t>(py * width + px)];
  }
};

SearchedViews search_views(const BeadViews& views, double diameter) {
  SearchedViews searched;
  const std::size_t num_views = views.tilt_deg.size();
  searched.spots.resize(num_views);
  searched.is_valid.resize(num_views);
  base::parallel_for(static_cast<std::int64_t>(num_views), [&](std::int64_t v) {
    const auto view = static_cast<std::size_t>(v);
    const MaskedImage image = views.read(view);
    searched.spots[view] = find_spots(image, diameter, kWeak);
    searched.is_valid[view].assign(image.valid.begin(), image.valid.end());
    if (view > 0) return;
    searched.width = image.width;
    searched.height = image.height;
  });
  return searched;
}

/// The views of lowest tilt.
std::vector<std::size_t> lowest_tilts(const BeadViews& views) {
  std::vector<std::size_t> order(views.tilt_deg.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::fabs(views.tilt_deg[a]) < std::fabs(views.tilt_deg[b]);
  });
  order.resize(std::min(order.size(), kDiameterViews));
  return order;
}

/// The spots of one size in several views.
struct SizeTrial {
  double about_px = 0.0;
  BeadProfile profile;
  double strength = 0.0;  ///< of all spots together
};

/// Diameter of the spots that stand out most; nothing if none does.
std::optional<double> estimate_diameter(const BeadViews& views, const BeadSearchOptions& options) {
  std::vector<SizeTrial> trials;
  for (double about = options.smallest_px; about <= options.largest_px; about *= kDiameterStep) {
    trials.push_back({about, BeadProfile(about)});
  }
  for (const std::size_t view : lowest_tilts(views)) {
    const MaskedImage image = views.read(view);
    base::parallel_for(static_cast<std::int64_t>(trials.size()), [&](std::int64_t i) {
      SizeTrial& trial = trials[static_cast<std::size_t>(i)];
      const std::vector<Spot> spots = find_spots(image, trial.about_px, kStrong);
      for (const Spot& spot : spots) trial.strength += spot.strength;
      trial.profile.add(image, spots);
    });
  }
  const auto best = std::max_element(
      trials.begin(), trials.end(),
      [](const SizeTrial& a, const SizeTrial& b) { return a.strength < b.strength; });
  if (best == trials.end() || best->strength == 0.0) return std::nullopt;
  return best->profile.diameter_px();
}

bool is_evident(const std::vector<BeadTrack>& tracks, std::size_t num_views) {
  const auto num_clear = std::count_if(tracks.begin(), tracks.end(), [&](const BeadTrack& track) {
    return static_cast<double>(track.num_found) >= kPartOfViews * static_cast<double>(num_views);
  });
  return num_clear >= static_cast<std::ptrdiff_t>(kFewestBeads);
}

/// Discs of one view: of the tracks, and of strong spots beside them.
std::vector<MaskDisc> discs_of_view(const std::vector<BeadTrack>& tracks,
                                    const std::vector<Spot>& spots, double middle_x,
                                    double tilt_deg, double tolerance, double radius,
                                    std::size_t* num_found) {
  std::vector<MaskDisc> discs;
  std::vector<bool> is_of_track(spots.size(), false);
  std::vector<double> contrasts;
  for (const BeadTrack& track : tracks) {
    MaskDisc disc{track_x(track, middle_x, tilt_deg), track.y_px, radius};
    const auto distance = [&](const Spot& spot) {
      return std::hypot(spot.x_px - disc.x_px, spot.y_px - disc.y_px);
    };
    const auto nearest =
        std::min_element(spots.begin(), spots.end(),
                         [&](const Spot& a, const Spot& b) { return distance(a) < distance(b); });
    if (nearest != spots.end() && distance(*nearest) <= tolerance) {
      disc.x_px = nearest->x_px;
      disc.y_px = nearest->y_px;
      is_of_track[static_cast<std::size_t>(nearest - spots.begin())] = true;
      contrasts.push_back(nearest->contrast);
      ++*num_found;
    }
    discs.push_back(disc);
  }
  if (contrasts.empty()) return discs;
  const auto middle = contrasts.begin() + static_cast<std::ptrdiff_t>(contrasts.size() / 2);
  std::nth_element(contrasts.begin(), middle, contrasts.end());
  for (std::size_t i = 0; i < spots.size(); ++i) {
    if (is_of_track[i] || spots[i].strength < kLikely ||
        spots[i].contrast < kPartOfContrast * *middle) {
      continue;
    }
    discs.push_back({spots[i].x_px, spots[i].y_px, radius});
  }
  return discs;
}

}  // namespace

BeadSearch find_beads(const BeadViews& views, const BeadSearchOptions& options) {
  BeadSearch result;
  const std::size_t num_views = views.tilt_deg.size();
  result.num_found.assign(num_views, 0);
  result.discs.resize(num_views);
  const auto diameter =
      options.diameter_px ? options.diameter_px : estimate_diameter(views, options);
  if (!diameter) return result;
  const SearchedViews searched = search_views(views, *diameter);
  const double middle_x = static_cast<double>(searched.width) / 2;
  TrackRules rules;
  rules.tolerance_px = std::max(2.0, 0.5 * *diameter);
  rules.largest_z_px = middle_x;
  rules.seed_strength = kStrong;
  const TrackedViews tracked{views.tilt_deg, middle_x, [&](std::size_t view, double x, double y) {
                               return searched.is_measured(view, x, y);
                             }};
  std::vector<BeadTrack> tracks = find_tracks(searched.spots, tracked, rules);
  if (!options.diameter_px && !is_evident(tracks, num_views)) return result;
  rules.seed_strength = kLikely;
  tracks = find_tracks(searched.spots, tracked, rules);
  result.diameter_px = *diameter;
  result.num_beads = tracks.size();
  for (std::size_t view = 0; view < num_views; ++view) {
    result.discs[view] =
        discs_of_view(tracks, searched.spots[view], middle_x, views.tilt_deg[view],
                      rules.tolerance_px, mask_radius_px(*diameter), &result.num_found[view]);
  }
  return result;
}

double mask_radius_px(double diameter_px) { return 1.2 * diameter_px; }

void mask_discs(const std::vector<MaskDisc>& discs, MaskedImage* image) {
  for (const MaskDisc& disc : discs) {
    const auto low = [&](double at) {
      return std::max<std::int64_t>(static_cast<std::int64_t>(std::floor(at - disc.radius_px)), 0);
    };
    const auto high = [&](double at, std::int64_t size) {
      return std::min(static_cast<std::int64_t>(std::ceil(at + disc.radius_px)), size);
    };
    for (std::int64_t y = low(disc.y_px); y < high(disc.y_px, image->height); ++y) {
      for (std::int64_t x = low(disc.x_px); x < high(disc.x_px, image->width); ++x) {
        const double distance = std::hypot(static_cast<double>(x) + 0.5 - disc.x_px,
                                           static_cast<double>(y) + 0.5 - disc.y_px);
        if (distance > disc.radius_px) continue;
        image->valid[image->index(x, y)] = 0;
        image->values[image->index(x, y)] = 0.0f;
      }
    }
  }
}

}  // namespace tomofield::tilt_series
