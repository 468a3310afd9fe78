#include "tilt_series/masks/beads.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "tilt_series/masks/bead_profile.h"
#include "tilt_series/masks/bead_tracks.h"
#include "tilt_series/masks/spots.h"
#include "tilt_series/own_views.h"

namespace tomofield::tilt_series {
namespace {

// Strengths of spots. Structure reaches 5 in the series that we know (simulated
// cells, dark-field films and particles); beads in vitreous ice reach 6 to 20.
constexpr double kStrong = 6.0;
constexpr double kLikely = 4.5;  // enough for a seed once it is known that there are beads
constexpr double kWeak = 3.5;    // enough where a track says that a bead is there

// The diameter is measured in the lowest tilts and, since beads may lie beside the field of view
// there, in some that are spread over all tilts.
constexpr std::size_t kLowViews = 5, kSpreadViews = 8;
constexpr double kDiameterStep = 1.4142135623730951;  // between the diameters that are tried

// Beads are taken as found if this many of them have spots in this part of all views each.
constexpr std::size_t kMinBeads = 3;
constexpr double kPartOfViews = 0.5;
// Beads that few views see count if this number of these views, and this part of them, show a
// strong spot. Specimens without beads have no such track.
constexpr std::size_t kMinStrongViews = 4;
constexpr double kStrongPartOfVisible = 0.6;  // spots at the border of a view are not found

// The maximum number of spots of a view that are followed. Nobody adds more beads, and with this
// limit the tracks of a view full of ice crystals are found in seconds.
constexpr std::size_t kMaxSpots = 1000;

// Spots may always be this far from their track, since alignment is no better.
constexpr double kMinTolerance_px = 2.0;

// A spot without a track is a bead's if it has this part of their median contrast in its view.
constexpr double kPartOfContrast = 0.5;

/// The spots of every view, and which of its pixels were measured.
struct SearchedViews {
  std::vector<std::vector<Spot>> spots;
  std::vector<std::vector<bool>> is_valid;
  std::int64_t width = 0, height = 0;
  double axis_x_px = 0.0;

  bool is_measured(std::size_t view, double x, double y) const {
    const auto px = static_cast<std::int64_t>(std::floor(x)),
               py = static_cast<std::int64_t>(std::floor(y));
    return px >= 0 && px < width && py >= 0 && py < height &&
           is_valid[view][static_cast<std::size_t>(py * width + px)];
  }
};

/// Returns the strongest spots of a view.
std::vector<Spot> strongest_spots(const MaskedImage& image, double diameter) {
  std::vector<Spot> spots = find_spots(image, diameter, kWeak);
  std::stable_sort(spots.begin(), spots.end(),
                   [](const Spot& a, const Spot& b) { return a.strength > b.strength; });
  spots.resize(std::min(spots.size(), kMaxSpots));
  return spots;
}

/// Looks for spots in the views that this process owns.
SearchedViews search_own_views(const BeadViews& views, double diameter,
                               const distributed::Communicator& processes) {
  SearchedViews searched;
  const std::size_t num_views = views.tilt_deg.size();
  searched.spots.resize(num_views);
  searched.is_valid.resize(num_views);
  std::vector<std::size_t> own;
  for (std::size_t view = 0; view < num_views; ++view)
    if (is_own_view(view, processes)) own.push_back(view);
  for_views("find beads", own, views.at_once, [&](std::size_t view) {
    const MaskedImage image = views.read(view);
    searched.spots[view] = strongest_spots(image, diameter);
    searched.is_valid[view].assign(image.valid.begin(), image.valid.end());
    if (view > 0) return;
    searched.width = image.width;
    searched.height = image.height;
  });
  return searched;
}

/// Broadcasts what the owner of a view found in it.
void broadcast_view(std::size_t view, const distributed::Communicator& processes,
                    SearchedViews* searched) {
  const int owner = owner_of_view(view, processes);
  std::vector<Spot>& spots = searched->spots[view];
  std::int64_t num_spots = is_own_view(view, processes) ? std::ssize(spots) : 0;
  processes.allreduce_sum(std::span(&num_spots, 1));
  spots.resize(static_cast<std::size_t>(num_spots));
  processes.broadcast(std::as_writable_bytes(std::span(spots)), owner);
  std::vector<bool>& is_valid = searched->is_valid[view];
  std::vector<std::uint8_t> valid(is_valid.begin(), is_valid.end());
  valid.resize(static_cast<std::size_t>(searched->width * searched->height));
  processes.broadcast(std::as_writable_bytes(std::span(valid)), owner);
  is_valid.assign(valid.begin(), valid.end());
}

SearchedViews search_views(const BeadViews& views, double diameter,
                           const distributed::Communicator& processes) {
  SearchedViews searched;
  processes.run_collectively([&] { searched = search_own_views(views, diameter, processes); });
  if (processes.size() > 1) {
    // Only the owner of the first view has set them.
    processes.allreduce_sum(std::span(&searched, 1), &SearchedViews::width, &SearchedViews::height);
    for (std::size_t view = 0; view < views.tilt_deg.size(); ++view)
      broadcast_view(view, processes, &searched);
  }
  searched.axis_x_px = views.axis_x_px.value_or(static_cast<double>(searched.width) / 2);
  return searched;
}

/// Returns a view on every process.
MaskedImage read_on_all(const BeadViews& views, std::size_t view,
                        const distributed::Communicator& processes) {
  MaskedImage image;
  processes.run_collectively([&] {
    if (is_own_view(view, processes)) image = views.read(view);
  });
  if (processes.size() == 1) return image;
  processes.allreduce_sum(std::span(&image, 1), &MaskedImage::width, &MaskedImage::height);
  const auto size = static_cast<std::size_t>(image.width * image.height);
  image.values.resize(size);
  image.valid.resize(size);
  const int owner = owner_of_view(view, processes);
  processes.broadcast(std::as_writable_bytes(std::span(image.values)), owner);
  processes.broadcast(std::as_writable_bytes(std::span(image.valid)), owner);
  return image;
}

/// Returns the views that the diameter is measured in: the lowest tilts, and some of all others.
std::vector<std::size_t> diameter_views(const BeadViews& views) {
  std::vector<std::size_t> order(views.tilt_deg.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::fabs(views.tilt_deg[a]) < std::fabs(views.tilt_deg[b]);
  });
  if (order.size() <= kLowViews + kSpreadViews) return order;
  std::vector<std::size_t> chosen(order.begin(), order.begin() + kLowViews);
  const std::size_t num_others = order.size() - kLowViews;
  for (std::size_t i = 1; i <= kSpreadViews; ++i)
    chosen.push_back(order[kLowViews - 1 + i * num_others / kSpreadViews]);
  return chosen;
}

/// The spots of one size in several views.
struct SizeTrial {
  double about_px = 0.0;
  BeadProfile profile;
  double strength = 0.0;  ///< of all spots together
};

/// The size of the spots that stand out most.
struct SpotSize {
  double about_px = 0.0;     ///< the trial that makes them stand out
  double diameter_px = 0.0;  ///< their full width at half height
};

/// Returns the size of the spots that stand out most; nothing if none does.
std::optional<SpotSize> estimate_size(const BeadViews& views, const BeadSearchOptions& options,
                                      const distributed::Communicator& processes) {
  std::vector<SizeTrial> trials;
  for (double about = options.smallest_px; about <= options.largest_px; about *= kDiameterStep) {
    trials.push_back({about, BeadProfile(about)});
  }
  for (const std::size_t view : diameter_views(views)) {
    const MaskedImage image = read_on_all(views, view, processes);
    base::parallel_for("compare beads", static_cast<std::int64_t>(trials.size()),
                       [&](std::int64_t i) {
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
  const auto width_px = best->profile.diameter_px();
  if (!width_px) return std::nullopt;
  // Fringes of a contrast transfer make small spots narrower than their beads.
  return SpotSize{best->about_px, std::max(*width_px, options.smallest_px)};
}

/// Tells whether at least three beads have a spot in at least half of all views each, or strong
/// spots in nearly all of the few views that see them (beads beside the field of view), together as
/// many as one bead in half of all views.
bool is_evident(const std::vector<BeadTrack>& tracks, std::size_t num_views) {
  const double half_of_views = kPartOfViews * static_cast<double>(num_views);
  std::size_t num_lasting = 0, num_clear = 0, num_strong_spots = 0;
  for (const BeadTrack& track : tracks) {
    num_lasting += static_cast<double>(track.num_found) >= half_of_views;
    const bool is_clear = track.num_strong >= kMinStrongViews &&
                          static_cast<double>(track.num_strong) >=
                              kStrongPartOfVisible * static_cast<double>(track.num_visible);
    if (!is_clear) continue;
    ++num_clear;
    num_strong_spots += track.num_strong;
  }
  return num_lasting >= kMinBeads ||
         (num_clear >= kMinBeads && static_cast<double>(num_strong_spots) >= half_of_views);
}

double tolerance_of(double diameter_px) { return std::max(kMinTolerance_px, diameter_px / 2); }

/// Returns tracks through the spots of this diameter that begin with two of `seed_strength`.
std::vector<BeadTrack> find_bead_tracks(const SearchedViews& searched,
                                        const std::vector<double>& tilt_deg, double diameter_px,
                                        double seed_strength) {
  TrackRules rules;
  rules.tolerance_px = tolerance_of(diameter_px);
  rules.max_z_px = static_cast<double>(searched.width) / 2;
  rules.seed_strength = seed_strength;
  const TrackedViews tracked{
      tilt_deg, searched.axis_x_px,
      [&](std::size_t view, double x, double y) { return searched.is_measured(view, x, y); }};
  return find_tracks(searched.spots, tracked, rules);
}

/// Returns the diameter of beads; nothing if the series does not clearly have some. The evidence is
/// that of the size that stands out most: with fringes, it is not always the width of the spots.
std::optional<double> evident_diameter(const BeadViews& views, const BeadSearchOptions& options,
                                       const distributed::Communicator& processes) {
  const auto size = estimate_size(views, options, processes);
  if (!size) return std::nullopt;
  const SearchedViews searched = search_views(views, size->about_px, processes);
  const auto tracks = find_bead_tracks(searched, views.tilt_deg, size->about_px, kStrong);
  if (!is_evident(tracks, views.tilt_deg.size())) return std::nullopt;
  return size->diameter_px;
}

double distance_between(const Spot& spot, const MaskDisc& disc) {
  return std::hypot(spot.x_px - disc.x_px, spot.y_px - disc.y_px);
}

/// Returns the index of the spot of each disc: the nearest within `tolerance`, unless another disc
/// shares it (two beads that overlap); spots.size() where there is none.
std::vector<std::size_t> match_spots(const std::vector<MaskDisc>& discs,
                                     const std::vector<Spot>& spots, double tolerance) {
  std::vector<std::size_t> match, num_discs(spots.size(), 0);
  for (const MaskDisc& disc : discs) {
    const auto nearest =
        std::min_element(spots.begin(), spots.end(), [&](const Spot& a, const Spot& b) {
          return distance_between(a, disc) < distance_between(b, disc);
        });
    const bool is_near = nearest != spots.end() && distance_between(*nearest, disc) <= tolerance;
    match.push_back(is_near ? static_cast<std::size_t>(nearest - spots.begin()) : spots.size());
    if (is_near) ++num_discs[match.back()];
  }
  for (std::size_t& spot : match) {
    if (spot < spots.size() && num_discs[spot] > 1) spot = spots.size();
  }
  return match;
}

/// Returns discs on strong spots that no track has: they are beads that few views see.
std::vector<MaskDisc> loose_discs(const std::vector<Spot>& spots, const std::vector<bool>& is_taken,
                                  std::vector<double> bead_contrasts, double radius) {
  std::vector<MaskDisc> discs;
  if (bead_contrasts.empty()) return discs;
  const double usual = base::median_in_place(bead_contrasts);
  for (std::size_t i = 0; i < spots.size(); ++i) {
    if (is_taken[i] || spots[i].strength < kLikely || spots[i].contrast < kPartOfContrast * usual) {
      continue;
    }
    discs.push_back({spots[i].x_px, spots[i].y_px, radius});
  }
  return discs;
}

/// Moves the discs of a view, which are where the tracks are, to their spots
/// and adds those of spots without a track. Returns how many have a spot.
std::size_t settle_discs(const std::vector<Spot>& spots, double tolerance, double radius,
                         std::vector<MaskDisc>* discs) {
  const std::vector<MaskDisc> predicted = *discs;
  const std::vector<std::size_t> match = match_spots(predicted, spots, tolerance);
  std::vector<double> contrasts;
  for (std::size_t i = 0; i < discs->size(); ++i) {
    if (match[i] == spots.size()) continue;
    const Spot& spot = spots[match[i]];
    (*discs)[i].x_px = spot.x_px;
    (*discs)[i].y_px = spot.y_px;
    contrasts.push_back(spot.contrast);
  }
  std::vector<bool> is_taken(spots.size(), false);
  for (std::size_t i = 0; i < spots.size(); ++i) {
    is_taken[i] = std::any_of(predicted.begin(), predicted.end(), [&](const MaskDisc& disc) {
      return distance_between(spots[i], disc) <= tolerance;
    });
  }
  const auto loose = loose_discs(spots, is_taken, contrasts, radius);
  discs->insert(discs->end(), loose.begin(), loose.end());
  return contrasts.size();
}

/// Returns discs where the tracks pass a view, if that is within it.
std::vector<MaskDisc> predict_discs(const std::vector<BeadTrack>& tracks,
                                    const SearchedViews& searched, double tilt_deg, double radius) {
  std::vector<MaskDisc> discs;
  for (const BeadTrack& track : tracks) {
    const double x = track_x(track, searched.axis_x_px, tilt_deg);
    if (x < -radius || x > static_cast<double>(searched.width) + radius) continue;
    discs.push_back({x, track.y_px, radius});
  }
  return discs;
}

/// Returns the spots of each track, where a view has one whose place is
/// precise and that belongs to no other track.
std::vector<std::vector<BeadSpot>> spots_of_tracks(const std::vector<BeadTrack>& tracks,
                                                   const SearchedViews& searched,
                                                   const std::vector<double>& tilt_deg,
                                                   double tolerance) {
  std::vector<std::vector<BeadSpot>> spots_of(tracks.size());
  for (std::size_t view = 0; view < tilt_deg.size(); ++view) {
    const std::vector<Spot>& spots = searched.spots[view];
    std::vector<MaskDisc> places;
    for (const BeadTrack& track : tracks)
      places.push_back({track_x(track, searched.axis_x_px, tilt_deg[view]), track.y_px});
    const std::vector<std::size_t> match = match_spots(places, spots, tolerance);
    for (std::size_t i = 0; i < tracks.size(); ++i)
      if (match[i] < spots.size() && spots[match[i]].is_precise)
        spots_of[i].push_back({view, spots[match[i]].x_px, spots[match[i]].y_px});
  }
  return spots_of;
}

}  // namespace

BeadSearch find_beads(const BeadViews& views, const BeadSearchOptions& options,
                      const distributed::Communicator& processes) {
  BeadSearch result;
  const std::size_t num_views = views.tilt_deg.size();
  result.num_found.assign(num_views, 0);
  result.discs.resize(num_views);
  const auto diameter =
      options.diameter_px ? options.diameter_px : evident_diameter(views, options, processes);
  if (!diameter) return result;
  const SearchedViews searched = search_views(views, *diameter, processes);
  const double tolerance_px = tolerance_of(*diameter);
  const std::vector<BeadTrack> tracks =
      find_bead_tracks(searched, views.tilt_deg, *diameter, kLikely);
  if (tracks.empty() && !options.diameter_px) return result;
  result.diameter_px = *diameter;
  result.num_beads = tracks.size();
  result.spots = spots_of_tracks(tracks, searched, views.tilt_deg, tolerance_px);
  const double radius = mask_radius_px(*diameter);
  for (std::size_t view = 0; view < num_views; ++view) {
    result.discs[view] = predict_discs(tracks, searched, views.tilt_deg[view], radius);
    result.num_found[view] =
        settle_discs(searched.spots[view], tolerance_px, radius, &result.discs[view]);
  }
  return result;
}

double mask_radius_px(double diameter_px) { return 1.2 * diameter_px; }

void mask_discs(const std::vector<MaskDisc>& discs, MaskedImage* image) {
  for (const MaskDisc& disc : discs) {
    for_pixels_in(disc, image->width, image->height, [&](std::int64_t x, std::int64_t y) {
      image->valid[image->index(x, y)] = kNoMeasurement;
      image->values[image->index(x, y)] = 0.0f;
    });
  }
}

void mark_undecided(const std::vector<MaskDisc>& discs, MaskedImage* image) {
  for (const MaskDisc& disc : discs) {
    for_pixels_in(disc, image->width, image->height, [&](std::int64_t x, std::int64_t y) {
      std::uint8_t& valid = image->valid[image->index(x, y)];
      if (valid != kNoMeasurement) valid = kUndecidedBead;
    });
  }
}

}  // namespace tomofield::tilt_series
