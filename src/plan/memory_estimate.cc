#include "plan/memory_estimate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "base/plausible.h"
#include "base/threads/parallel.h"
#include "field/vm/factorise.h"
#include "fit/fit.h"
#include "fit/halo.h"
#include "fit/tree_updates.h"
#include "kernels/lanes.h"
#include "measurement/held_out.h"
#include "measurement/row_share.h"
#include "measurement/slab_views.h"
#include "objective/ray_data_term.h"
#include "prior/answer.h"
#include "projection/slab_projector.h"

namespace tomofield::plan {
namespace {

constexpr std::size_t kMpi = std::size_t{40} << 20;  // OpenMPI and its message buffers

constexpr int kSlabsOfBand = projection::SlabProjector::kSlabsTogether;
constexpr std::size_t kRow = kernels::kLanes * sizeof(float);

// Returns the bytes of a band that is worked on: a pair of slabs with their gradient and the views
// of a step, and rows for the total variation.
std::size_t band_memory(const measurement::Measurement& plan, const fit::Domain& domain,
                        int views_a_step) {
  const std::size_t slab = domain.grid.size() * sizeof(float);
  const std::size_t views =
      static_cast<std::size_t>(views_a_step) * static_cast<std::size_t>(plan.geometry.width) * kRow;
  return kSlabsOfBand * (2 * slab + views) + 3 * slab / kernels::kLanes;
}

// Returns how many bands of some rows are worked on at a time.
int num_bands_in_use(const fit::Domain& domain, std::int64_t num_rows) {
  const std::int64_t band_rows = domain.tree.roots().cell_size;
  return static_cast<int>(
      std::min<std::int64_t>(base::thread_count(), (num_rows + band_rows - 1) / band_rows));
}

// Returns the part of all parameters that this process keeps: its own and those of its neighbours
// in `rows` rows beyond its bands.
double part_of_parameters(const fit::Domain& domain, FieldKind kind,
                          const distributed::Communicator& processes, std::int64_t rows = 1) {
  if (processes.size() == 1) return 1.0;
  const measurement::RowShare share =
      measurement::row_share(domain.num_rows, domain.tree.roots().cell_size, processes);
  std::vector<field::LeafShape> needed;
  for (const int leaf : fit::needed_leaves(domain.tree, share, rows))
    needed.push_back(domain.shapes[static_cast<std::size_t>(leaf)]);
  return static_cast<double>(field::count_parameters(kind, needed)) /
         static_cast<double>(field::count_parameters(kind, domain.shapes));
}

// Returns the part of all parameters that belongs to leaves that rays meet. Their gradient and
// moments take memory; those of other leaves are never written, and those of small ones share their
// pages with others (base::AlignedBuffer).
double part_that_rays_meet(const fit::Domain& domain, FieldKind kind) {
  constexpr std::size_t kSmallLeaf = std::size_t{8} << 20;  // a few huge pages
  std::vector<field::LeafShape> met;
  for (int i = 0; i < domain.tree.num_leaves(); ++i) {
    const field::Square& square = domain.tree.leaf(i).square;
    const field::LeafShape& shape = domain.shapes[static_cast<std::size_t>(i)];
    const auto overlap = [](std::int64_t low, std::int64_t high, double from, double to) {
      return static_cast<double>(high) > from && to > static_cast<double>(low);
    };
    const bool meets_rays = overlap(square.x0, square.x1(), domain.support.x0, domain.support.x1) &&
                            overlap(square.y0, square.y1(), domain.support.y0, domain.support.y1);
    if (meets_rays || field::count_parameters(kind, {shape}) * sizeof(float) < kSmallLeaf)
      met.push_back(shape);
  }
  return static_cast<double>(field::count_parameters(kind, met)) /
         static_cast<double>(field::count_parameters(kind, domain.shapes));
}

// Returns the number of parameters in a stage over that at full resolution.
double part_in_stage(const fit::Domain& domain, const fit::Stage& stage) {
  return static_cast<double>(
             field::count_parameters(stage.field_kind, domain.shapes_in(domain.tree, stage.bin))) /
         static_cast<double>(field::count_parameters(stage.field_kind, domain.shapes));
}

// Returns the bytes in use while plain vertices become factors; 0 if they do not.
double factorising_bytes(const fit::Domain& domain, const std::vector<fit::Stage>& stages,
                         const FieldOptions& options, const distributed::Communicator& processes) {
  if (stages.front().field_kind == options.kind) return 0;
  std::size_t largest = 0;
  for (const field::LeafShape& shape : domain.shapes)
    largest = std::max(largest, field::factorising_memory(shape));
  return parameter_bytes(domain, options, FieldKind::kGrid, processes) +
         parameter_bytes(domain, options, options.kind, processes) +
         static_cast<double>(largest) * base::thread_count();
}

// Returns the shape of the rays of the process that has the most rows.
measurement::SlabViews::Shape own_part(measurement::SlabViews::Shape shape,
                                       const fit::Domain& domain,
                                       const distributed::Communicator& processes) {
  const std::int64_t band_rows = domain.tree.roots().cell_size;
  std::int64_t most = 0;
  for (int rank = 0; rank < processes.size(); ++rank) {
    const auto share = measurement::row_share(shape.num_rows, band_rows, rank, processes.size());
    most = std::max(most, share.bands.size() * band_rows + share.rows_for_next);
  }
  shape.num_rows = std::min(shape.num_rows, most);
  return shape;
}

// Returns the bytes that this process takes for an answer of the learned prior, with the rows that
// it exchanges with its neighbours.
std::size_t answer_memory(const measurement::Measurement& plan, const fit::Domain& domain,
                          const distributed::Communicator& processes) {
  const prior::BoxShape lattice{static_cast<int>(plan.roi.width()),
                                static_cast<int>(std::lround(plan.geometry.thickness)),
                                static_cast<int>(plan.roi.height())};
  const std::int64_t band_rows = domain.tree.roots().cell_size;
  const base::Range bands = measurement::row_share(domain.num_rows, band_rows, processes).bands;
  const auto row_at = [&](int band) {
    return static_cast<int>(std::min(band * band_rows, domain.num_rows));
  };
  const prior::BoxShape beyond{lattice.nx, lattice.nz, prior::kRowsBeyond};
  const std::size_t exchanged = processes.size() > 1 ? 4 * beyond.size() * sizeof(float) : 0;
  return prior::answer_memory(lattice, {row_at(bands.begin), row_at(bands.end)}) + exchanged;
}

// Returns the bytes that the learned prior adds to those of the fitted field: one more number for
// each parameter, leaves of the neighbours that it alone reads, and what its answer takes beyond
// the room that the gradient and the two moments make for it.
double prior_memory(const PlannedFit& planned) {
  const auto& [series, plan, domain, options, processes] = planned;
  if (options.fit.prior == Prior::kTv) return 0;
  const double parameters = parameter_bytes(domain, options.field, FieldKind::kGrid, processes);
  const double with_rows_beyond =
      parameters *
      part_of_parameters(domain, FieldKind::kGrid, processes, fit::rows_beyond(options.fit.prior)) /
      part_of_parameters(domain, FieldKind::kGrid, processes);
  const double answer = options.fit.prior == Prior::kLearned
                            ? static_cast<double>(answer_memory(plan, domain, processes))
                            : 0.0;
  return 2 * with_rows_beyond - parameters + std::max(0.0, answer - 3 * parameters);
}

}  // namespace

std::size_t thread_memory(const measurement::Measurement& plan, const fit::Domain& domain) {
  std::size_t leaf = 0;
  for (const field::LeafShape& shape : domain.shapes)
    leaf = std::max(leaf, 2 * shape.vertices_xz() * kRow);
  const std::size_t written = std::min(
      std::size_t{16} << 20,
      static_cast<std::size_t>(static_cast<double>(plan.roi.width()) * plan.geometry.thickness) *
          kRow);
  return leaf + written;
}

std::size_t leaves_of_threads(const fit::Domain& domain) {
  std::vector<std::size_t> bytes;
  for (const field::LeafShape& shape : domain.shapes)
    bytes.push_back(shape.vertices_xz() * static_cast<std::size_t>(shape.ny) * sizeof(float));
  const auto count = std::min(std::ssize(bytes), std::ptrdiff_t{base::thread_count()});
  const auto largest = std::span(bytes).first(static_cast<std::size_t>(count));
  std::ranges::partial_sort(bytes, bytes.begin() + count, std::greater{});
  return std::accumulate(largest.begin(), largest.end(), std::size_t{0});
}

std::size_t bands_memory(const measurement::Measurement& plan, const fit::Domain& domain,
                         const FitOptions& options, std::int64_t num_rows) {
  const int steps = steps_an_epoch(plan, options);
  const int views_a_step = plan.ray_geometry ? 0 : (plan.geometry.num_views() + steps - 1) / steps;
  return static_cast<std::size_t>(num_bands_in_use(domain, num_rows)) *
         band_memory(plan, domain, views_a_step);
}

int num_fitted_views(const measurement::Measurement& plan, const FitOptions& options) {
  const auto held_out = measurement::held_out_views(plan.geometry.tilt_deg, options.hold_out);
  return plan.geometry.num_views() - static_cast<int>(held_out.size());
}

int steps_an_epoch(const measurement::Measurement& plan, const FitOptions& options) {
  if (plan.ray_geometry) return options.subsets;
  return std::min(options.subsets, num_fitted_views(plan, options));
}

std::size_t max_parameters(const fit::Domain& domain, const FieldOptions& options, FieldKind kind) {
  const std::size_t now = field::count_parameters(kind, domain.shapes);
  if (options.tree != TreeKind::kAdaptive) return now;
  std::int64_t num_inside = 0;
  field::LeafShape first_inside;
  for (int i = 0; i < domain.tree.num_leaves(); ++i) {
    if (domain.tree.leaf(i).region != field::Region::kInterest) continue;
    if (num_inside++ == 0) first_inside = domain.shapes[static_cast<std::size_t>(i)];
  }
  // A leaf may become four, but not sixteen (fit::TreeUpdates).
  constexpr std::int64_t kMostOfOne = 4;
  const std::int64_t more =
      std::min<std::int64_t>(options.leaf_budget, kMostOfOne * num_inside) - num_inside;
  if (more <= 0) return now;
  const base::CheckedSize of_leaf = field::count_parameters(kind, {first_inside});
  // Copies of this many bytes can still be added up.
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 64;
  return static_cast<std::size_t>((of_leaf * more + now).find(kMost).value_or(kMost));
}

double parameter_bytes(const fit::Domain& domain, const FieldOptions& options, FieldKind kind,
                       const distributed::Communicator& processes) {
  return static_cast<double>(sizeof(float) * max_parameters(domain, options, kind)) *
         part_of_parameters(domain, kind, processes);
}

double fitted_bytes(const fit::Domain& domain, const std::vector<fit::Stage>& stages,
                    const FieldOptions& options, const distributed::Communicator& processes) {
  constexpr double kCopiesThatRaysWrite = 3;  // the gradient and two moments
  constexpr double kCopiesOfChange = 6;       // two of the parameters and of each moment
  const bool tree_may_change = fit::tree_may_change(options, stages.front());
  FieldOptions largest_field = options;
  if (!tree_may_change) largest_field.leaf_budget = 0;
  double largest = 0;
  for (const fit::Stage& s : stages) {
    const bool may_change = tree_may_change && &s == &stages.front();
    const double met = part_that_rays_meet(domain, s.field_kind);
    const double copies = may_change ? kCopiesOfChange + met : 1 + kCopiesThatRaysWrite * met;
    largest =
        std::max(largest, copies * part_in_stage(domain, s) *
                              parameter_bytes(domain, largest_field, s.field_kind, processes));
  }
  return largest;
}

std::size_t estimate_memory(const PlannedFit& planned, const std::vector<fit::Stage>& stages) {
  using measurement::SlabViews;
  const auto& [series, plan, domain, options, processes] = planned;
  const auto parameters =
      static_cast<std::size_t>(fitted_bytes(domain, stages, options.field, processes));
  const auto factorising =
      static_cast<std::size_t>(factorising_bytes(domain, stages, options.field, processes));
  const SlabViews::Shape own_shape = own_part(plan.rays_shape(), domain, processes);
  const int bands_in_use = num_bands_in_use(domain, own_shape.num_rows);
  const int slabs_in_use = kSlabsOfBand * bands_in_use;
  // The rays of all frames stay beside those of a half.
  const std::size_t ray_sets = options.files.even ? 2 : 1;
  const std::size_t rays = ray_sets * SlabViews::resident_memory(own_shape, slabs_in_use);
  std::size_t coarse_rays = 0;  // of the last coarse stage, which has the most
  for (const fit::Stage& s : stages) {
    if (s.bin == 1) continue;
    coarse_rays =
        SlabViews::resident_memory(SlabViews::binned_shape(own_shape, s.bin), slabs_in_use);
  }
  const int steps = steps_an_epoch(plan, options.fit);
  const std::size_t surrogates =
      options.filters_views()
          ? fit::surrogate_memory(own_shape, plan.rays_shape(), steps, slabs_in_use)
          : 0;
  const std::size_t fitting =
      parameters + surrogates + static_cast<std::size_t>(prior_memory(planned)) +
      std::max(bands_memory(plan, domain, options.fit, own_shape.num_rows),
               leaves_of_threads(domain)) +  // whose spikes are limited
      static_cast<std::size_t>(base::thread_count()) * thread_memory(plan, domain);
  const std::size_t tracing =
      plan.ray_geometry ? leaves_of_threads(domain) + objective::RayDataTerm::working_memory(
                                                          *plan.ray_geometry, domain.tree,
                                                          {plan.roi, domain.support}, options.fit,
                                                          plan.rays_shape())
                        : 0;
  const std::size_t program = kProgramBytes + (processes.size() > 1 ? kMpi : 0);
  const std::size_t decoding = measurement::decoding_memory(series, plan, processes);
  // The stored views make room for the rays one by one.
  return program +
         std::max(series.stored_memory(processes) + decoding,
                  rays + coarse_rays + std::max({fitting + tracing, factorising, decoding}));
}

}  // namespace tomofield::plan
