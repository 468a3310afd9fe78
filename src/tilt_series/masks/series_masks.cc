#include "tilt_series/masks/series_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/tables/fiducial_points.h"
#include "tilt_series/resampling/binning.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

constexpr double kAngstromsANanometre = 10.0;

// Diameters in this range are tried where none is given: gold markers have 3 to 30 nm,
// and blurred ones look larger. Smaller spots are atoms or noise.
constexpr double kSmallest_nm = 2.0, kLargest_nm = 40.0;
constexpr double kSmallest_px = 3.0;       // below it spots look like noise
constexpr double kSmallestGiven_px = 2.0;  // and here they cannot be told at all
constexpr double kLargestPart = 0.125;     // of the view's shorter side

double binned_pixel_A(const SeriesPlan& plan) { return plan.pixel_size_A * plan.bin_factor; }

double shorter_side_px(const SeriesPlan& plan) {
  return static_cast<double>(
      reduced_size(std::min(plan.aligned_width, plan.aligned_height), plan.bin_factor));
}

double given_diameter_px(double diameter_nm, const SeriesPlan& plan) {
  const double pixel_A = binned_pixel_A(plan);
  const double diameter_px = diameter_nm * kAngstromsANanometre / pixel_A;
  const double largest_px = largest_bead_px(shorter_side_px(plan));
  if (diameter_px >= kSmallestGiven_px && diameter_px <= largest_px) return diameter_px;
  throw Error(fmt::format(
      "--bead-diameter {:g} nm is {:.3g} pixels of {:.4g} Å; beads can be found from {:g} to {:g} "
      "pixels in views of {:g}: give the diameter in nm, check the pixel size (--pixel-size) and "
      "the binning, or "
      "turn the search off with --bead-diameter 0",
      diameter_nm, diameter_px, pixel_A, kSmallestGiven_px, largest_px, shorter_side_px(plan)));
}

BeadSearchOptions search_options(const TiltSeriesOptions& options, const SeriesPlan& plan) {
  BeadSearchOptions search;
  if (options.bead_diameter_nm.has_value()) {
    search.diameter_px = given_diameter_px(*options.bead_diameter_nm, plan);
    return search;
  }
  const double px_per_nm = kAngstromsANanometre / binned_pixel_A(plan);
  search.smallest_px = std::max(kSmallest_px, kSmallest_nm * px_per_nm);
  search.largest_px = std::min(kLargest_nm * px_per_nm, largest_bead_px(shorter_side_px(plan)));
  return search;
}

/// Returns where a point of a section is in its aligned, binned view.
MaskDisc place_in_view(const io::FiducialPoint& point, const PlannedView& view,
                       const SeriesPlan& plan, const io::MrcHeader& header) {
  const RawFromAligned& transform = view.raw_from_aligned;
  const double px = point.x_px - static_cast<double>(header.nx) / 2 - transform.shift_x_px;
  const double py = point.y_px - static_cast<double>(header.ny) / 2 - transform.shift_y_px;
  const double determinant = transform.m11 * transform.m22 - transform.m12 * transform.m21;
  double qx = (transform.m22 * px - transform.m12 * py) / determinant;
  double qy = (transform.m11 * py - transform.m21 * px) / determinant;
  if (view.local) {
    const auto d = view.local->displacement(qx, qy);
    qx += d[0], qy += d[1];
  }
  const auto middle = [&](std::int64_t size) {
    return static_cast<double>(reduced_size(size, plan.bin_factor)) / 2;
  };
  return {qx / plan.bin_factor + middle(plan.aligned_width),
          qy / plan.bin_factor + middle(plan.aligned_height), 0.0};
}

void require_in_stack(const io::FiducialPoint& point, const std::filesystem::path& file,
                      const io::ImageStack& stack) {
  const io::MrcHeader& header = stack.header();
  const auto section = std::llround(point.section);
  if (section >= 0 && section < header.nz && point.x_px >= 0 && point.y_px >= 0 &&
      point.x_px <= static_cast<double>(header.nx) &&
      point.y_px <= static_cast<double>(header.ny)) {
    return;
  }
  throw Error(fmt::format(
      "'{}', line {}: the point {:g}, {:g} of section {:g} lies outside '{}', which has {} × {} "
      "pixels and sections 0 to {}; give a model that was made on this stack",
      file.string(), point.line, point.x_px, point.y_px, point.section, stack.name(), header.nx,
      header.ny, header.nz - 1));
}

/// Returns the fiducials of every view; their radius is still 0.
std::vector<std::vector<MaskDisc>> place_fiducials(const std::filesystem::path& file,
                                                   const SeriesPlan& plan,
                                                   const io::ImageStack& stack) {
  std::vector<std::vector<MaskDisc>> places(plan.views.size());
  for (const io::FiducialPoint& point : io::read_fiducial_points(file)) {
    require_in_stack(point, file, stack);
    for (std::size_t view = 0; view < places.size(); ++view) {
      if (plan.views[view].view.section != std::llround(point.section)) continue;
      places[view].push_back(place_in_view(point, plan.views[view], plan, stack.header()));
    }
  }
  return places;
}

/// Searches the views and keeps what is found as masks or as undecided.
void add_beads(const TiltSeriesOptions& options, const SeriesPlan& plan, const BeadViews& views,
               const distributed::Communicator& processes, BeadMasks* masks) {
  BeadSearch search = search_beads(options, plan, views, processes);
  MaskMetrics& metrics = masks->metrics;
  metrics.beads_found = std::move(search.num_found);
  metrics.num_beads = search.num_beads;
  metrics.bead_diameter_A = search.diameter_px * binned_pixel_A(plan);
  if (search.num_beads == 0) return;
  const bool is_undecided =
      options.contrast == Contrast::kBright && !options.bead_diameter_nm.has_value();
  metrics.bead_masking = is_undecided ? BeadMasking::kUndecided : BeadMasking::kMasked;
  (is_undecided ? masks->undecided : masks->discs) = std::move(search.discs);
}

void add_fiducials(const TiltSeriesOptions& options, const SeriesPlan& plan,
                   const io::ImageStack& stack, BeadMasks* masks) {
  if (!options.fiducials) return;
  const double diameter_px = masks->metrics.bead_diameter_A / binned_pixel_A(plan);
  auto places = place_fiducials(*options.fiducials, plan, stack);
  if (!(diameter_px > 0.0)) {
    throw Error(
        fmt::format("--fiducials '{}' says where beads are, but not how large: give their size "
                    "with --bead-diameter NM",
                    options.fiducials->string()));
  }
  for (std::size_t view = 0; view < places.size(); ++view) {
    for (MaskDisc& disc : places[view]) {
      disc.radius_px = mask_radius_px(diameter_px);
      masks->discs[view].push_back(disc);
    }
  }
}

}  // namespace

std::string describe_beads(const MaskMetrics& masks) {
  if (masks.num_beads == 0) return "no beads";
  return fmt::format("{} beads of {:.3g} nm", masks.num_beads, masks.bead_diameter_A / 10);
}

double largest_bead_px(double shorter_side_px) { return kLargestPart * shorter_side_px; }

io::MrcReader open_mask(const std::filesystem::path& mask, const io::ImageStack& stack) {
  io::MrcReader reader(mask);
  const io::MrcHeader &have = reader.header(), &want = stack.header();
  if (have.nx == want.nx && have.ny == want.ny && have.nz == want.nz) return reader;
  throw Error(fmt::format(
      "the mask '{}' has {} × {} pixels and {} sections, the stack '{}' has {} × {} and {}: a mask "
      "must have a section for every section of the stack, of the same size (0 is left out, all "
      "else counts)",
      mask.string(), have.nx, have.ny, have.nz, stack.name(), want.nx, want.ny, want.nz));
}

std::int64_t apply_mask(const io::MrcReader& mask, std::int64_t section, MaskedImage* image) {
  std::vector<float> counts(image->values.size());
  std::int64_t num_masked = 0;
  mask.read_section(section, counts);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (!std::isfinite(counts[i]))
      throw Error(
          fmt::format("the mask '{}' has a pixel that is no number, in section {}: write 0 "
                      "where a pixel is left out, and 1 elsewhere",
                      mask.path().string(), section + 1));
    if (counts[i] != 0.0f) continue;
    ++num_masked;
    image->valid[i] = 0;
    image->values[i] = 0.0f;
  }
  return num_masked;
}

bool searches_beads(const TiltSeriesOptions& options) { return options.bead_diameter_nm != 0.0; }

BeadSearch search_beads(const TiltSeriesOptions& options, const SeriesPlan& plan,
                        const BeadViews& views, const distributed::Communicator& processes) {
  BeadSearchOptions how;
  processes.run_collectively([&] { how = search_options(options, plan); });
  return find_beads(views, how, processes);
}

BeadMasks find_bead_masks(const TiltSeriesOptions& options, const SeriesPlan& plan,
                          const io::ImageStack& stack, const BeadViews& views,
                          const distributed::Communicator& processes) {
  BeadMasks masks;
  masks.discs.resize(plan.views.size());
  masks.undecided.resize(plan.views.size());
  masks.metrics.beads_found.assign(plan.views.size(), 0);
  if (searches_beads(options)) add_beads(options, plan, views, processes, &masks);
  processes.run_collectively([&] { add_fiducials(options, plan, stack, &masks); });
  for (const auto& discs : masks.discs) masks.metrics.beads_masked.push_back(discs.size());
  return masks;
}

}  // namespace tomofield::tilt_series
