#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "baseline/run_baseline.h"
#include "evaluate/block_fsc.h"
#include "evaluate/local_resolution.h"
#include "field/vm/factorise.h"
#include "fit/domain.h"
#include "fit/fit.h"
#include "fit/halo.h"
#include "fit/stages.h"
#include "kernels/lanes.h"
#include "measurement/held_out.h"
#include "measurement/row_share.h"
#include "measurement/slab_views.h"
#include "objective/ray_data_term.h"
#include "projection/slab_projector.h"
#include "reconstruct/reconstruct.h"
#include "selection/trial_measurement.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

constexpr std::size_t kProgram = std::size_t{20} << 20;  // the program with its libraries
constexpr std::size_t kMpi = std::size_t{40} << 20;      // OpenMPI and its message buffers

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

// Returns the bytes of a thread: the vertices of a leaf, and later a part of the volume.
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

int num_fitted_views(const measurement::Measurement& plan, const fit::FitOptions& options) {
  const auto held_out = measurement::held_out_views(plan.geometry.tilt_deg, options.hold_out);
  return plan.geometry.num_views() - static_cast<int>(held_out.size());
}

int steps_an_epoch(const measurement::Measurement& plan, const fit::FitOptions& options) {
  if (plan.ray_geometry) return objective::ray_steps_per_epoch(options, plan.rays_shape());
  return std::min(options.subsets, num_fitted_views(plan, options));
}

// Returns the number of parameters as a field of this kind. An adaptive tree counts with all leaves
// of its budget.
std::size_t max_parameters(const fit::Domain& domain, const fit::FieldOptions& options,
                           FieldKind kind) {
  std::vector<field::LeafShape> shapes = domain.shapes, inside;
  for (int i = 0; i < domain.tree.num_leaves(); ++i) {
    if (domain.tree.leaf(i).region == field::Region::kInterest)
      inside.push_back(domain.shapes[static_cast<std::size_t>(i)]);
  }
  const auto more = options.leaf_budget - static_cast<std::ptrdiff_t>(inside.size());
  if (options.tree == TreeKind::kAdaptive && more > 0)
    shapes.insert(shapes.end(), static_cast<std::size_t>(more), inside.front());
  return field::count_parameters(kind, shapes);
}

// Returns the part of all parameters that this process keeps: its own and those of its neighbours.
double part_of_parameters(const fit::Domain& domain, FieldKind kind,
                          const distributed::Communicator& processes) {
  if (processes.size() == 1) return 1.0;
  const measurement::RowShare share =
      measurement::row_share(domain.num_rows, domain.tree.roots().cell_size, processes);
  std::vector<field::LeafShape> needed;
  for (const int leaf : fit::needed_leaves(domain.tree, share))
    needed.push_back(domain.shapes[static_cast<std::size_t>(leaf)]);
  return static_cast<double>(field::count_parameters(kind, needed)) /
         static_cast<double>(field::count_parameters(kind, domain.shapes));
}

// Returns the bytes of the parameters of this process as a field of this kind.
double parameter_bytes(const fit::Domain& domain, const fit::FieldOptions& options, FieldKind kind,
                       const distributed::Communicator& processes) {
  return static_cast<double>(sizeof(float) * max_parameters(domain, options, kind)) *
         part_of_parameters(domain, kind, processes);
}

// Returns the bytes of the parameters, their gradient and two moments in the stage with the most.
// When an adaptive tree changes, all but the gradient are there twice.
double fitted_bytes(const fit::Domain& domain, const RunPlan& run, const fit::FieldOptions& options,
                    const distributed::Communicator& processes) {
  const double copies = options.tree == TreeKind::kAdaptive ? 7 : 4;
  double largest = 0;
  for (const fit::Stage& s : run.stages)
    largest = std::max(largest, copies * parameter_bytes(domain, options, s.field_kind, processes));
  return largest;
}

// Returns the bytes in use while plain vertices become factors; 0 if they do not.
double factorising_bytes(const fit::Domain& domain, const RunPlan& run,
                         const fit::FieldOptions& options,
                         const distributed::Communicator& processes) {
  if (run.stages.front().field_kind == options.kind) return 0;
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

// Returns the peak memory of a process.
std::size_t estimate_memory(const tilt_series::TiltSeries& series,
                            const measurement::Measurement& plan, const fit::Domain& domain,
                            const RunPlan& run, const ReconstructOptions& options,
                            const distributed::Communicator& processes) {
  using measurement::SlabViews;
  const auto parameters =
      static_cast<std::size_t>(fitted_bytes(domain, run, options.field, processes));
  const auto factorising =
      static_cast<std::size_t>(factorising_bytes(domain, run, options.field, processes));
  const SlabViews::Shape own_shape = own_part(plan.rays_shape(), domain, processes);
  const std::int64_t num_bands =
      (own_shape.num_rows + domain.tree.roots().cell_size - 1) / domain.tree.roots().cell_size;
  const int bands_in_use =
      static_cast<int>(std::min<std::int64_t>(base::thread_count(), num_bands));
  const int slabs_in_use = kSlabsOfBand * bands_in_use;
  // The rays of all frames stay beside those of a half.
  const std::size_t ray_sets = options.files.even ? 2 : 1;
  const std::size_t rays = ray_sets * SlabViews::resident_memory(own_shape, slabs_in_use);
  std::size_t coarse_rays = 0;  // of the last coarse stage, which has the most
  for (const fit::Stage& s : run.stages) {
    if (s.bin == 1) continue;
    coarse_rays =
        SlabViews::resident_memory(SlabViews::binned_shape(own_shape, s.bin), slabs_in_use);
  }
  const int steps = steps_an_epoch(plan, options.fit);
  const int views_a_step = plan.ray_geometry ? 0 : (run.num_views + steps - 1) / steps;
  const std::size_t fitting =
      parameters +
      static_cast<std::size_t>(bands_in_use) * band_memory(plan, domain, views_a_step) +
      static_cast<std::size_t>(base::thread_count()) * thread_memory(plan, domain);
  const std::size_t tracing =
      plan.ray_geometry ? objective::RayDataTerm::working_memory(*plan.ray_geometry, domain.tree,
                                                                 options.fit, plan.rays_shape())
                        : 0;
  const std::size_t program = kProgram + (processes.size() > 1 ? kMpi : 0);
  const std::size_t decoding = measurement::decoding_memory(series, plan, processes);
  // The stored views make room for the rays one by one.
  return program +
         std::max(series.stored_memory(processes) + decoding,
                  rays + coarse_rays + std::max({fitting + tracing, factorising, decoding}));
}

// Returns the peak memory of a process while it aligns the views.
std::size_t memory_of_alignment(const tilt_series::TiltSeries& series,
                                const measurement::Measurement& plan, RunPlan run,
                                ReconstructOptions options,
                                const distributed::Communicator& processes) {
  const bool from_raw = options.resolved.align == Alignment::kFull;
  options.field = align::planned_field(options.field);
  options.fit = align::planned_fits(from_raw, options.fit.seed).front().options;
  run.stages = fit::make_stages(options.field, options.fit);
  const fit::Domain domain = fit::make_domain(plan.geometry, plan.roi, options.field);
  return estimate_memory(series, plan, domain, run, options, processes) +
         series.stored_memory(processes) + align::memory_beside_fit(plan);
}

// Returns the bytes that writing the results of halves takes: the rays, and a model that is
// sampled, or what compares the volumes or makes linear ones.
std::size_t memory_of_halves(const tilt_series::TiltSeries& series,
                             const measurement::Measurement& plan, const fit::Domain& domain,
                             const ReconstructOptions& options) {
  const auto model = static_cast<std::size_t>(parameter_bytes(
      domain, options.field, options.field.kind, distributed::Communicator::alone()));
  const base::Shape3 shape{plan.roi.width(), plan.roi.height(),
                           static_cast<std::int64_t>(plan.geometry.thickness)};
  const std::size_t linear = options.resolved.denoising_halves
                                 ? baseline::plan_baseline(series, {options.files, options.resolved,
                                                                    baseline::WbpOptions{}})
                                       .memory_bytes
                                 : 0;
  const std::size_t sampling =
      model + static_cast<std::size_t>(base::thread_count()) * thread_memory(plan, domain);
  return kProgram + measurement::SlabViews::resident_memory(plan.rays_shape(), 0) +
         std::max({sampling, evaluate::block_fsc_memory(shape),
                   evaluate::local_resolution_memory(shape), linear});
}

// Refuses tilts that cannot be divided: each half needs views over the whole range.
void require_views_for_halves(const measurement::Measurement& plan,
                              const ReconstructOptions& options) {
  constexpr int kFewest = 8;
  const int num_views = num_fitted_views(plan, options.fit);
  if (!options.resolved.split_tilts || num_views >= kFewest) return;
  throw Error(
      fmt::format("--split-tilts needs {} views or more, and there are {}", kFewest, num_views));
}

void require_views_for_trials(const measurement::Measurement& plan,
                              const fit::FitOptions& options) {
  const std::vector<double>& tilt_deg = plan.geometry.tilt_deg;
  selection::trial_views(tilt_deg, measurement::held_out_views(tilt_deg, options.hold_out));
}

// Returns the largest number of vertices along an axis of a leaf.
int most_vertices(const fit::Domain& domain) {
  int most = 0;
  for (const field::LeafShape& shape : domain.shapes) most = std::max({most, shape.nx, shape.nz});
  return most;
}

}  // namespace

RunPlan plan_run(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                 const distributed::Communicator& processes) {
  if (processes.size() > 1) base::require_no_faults(options.faults_of_job());
  const measurement::Measurement plan = measurement::plan_measurement(series, options.specimen);
  const fit::Domain domain = plan.ray_geometry
                                 ? fit::make_domain(*plan.ray_geometry, plan.roi, options.field)
                                 : fit::make_domain(plan.geometry, plan.roi, options.field);
  RunPlan run;
  run.num_views = plan.geometry.num_views();
  run.view_width = plan.geometry.width;
  run.view_height = plan.geometry.height;
  run.pixel_size_A = plan.pixel_size_A;
  run.roi = plan.roi;
  run.thickness = plan.geometry.thickness;
  run.num_leaves = domain.tree.num_leaves();
  run.num_parameters = max_parameters(domain, options.field, options.field.kind);
  run.stages = fit::make_stages(options.field, options.fit);
  const fit::Stage& last = run.stages.back();
  // Only the views tell whether there is a background or an undecided bead.
  run.num_trials = options.num_trials(
      num_fitted_views(plan, options.fit),
      {.variation = options.open.variation, .view_scale = options.open.view_scale});
  if (run.num_trials > 0) require_views_for_trials(plan, options.fit);
  run.steps_an_epoch = steps_an_epoch(plan, options.fit);
  run.num_steps = (last.first_epoch + last.epochs) * run.steps_an_epoch;
  run.memory_bytes = estimate_memory(series, plan, domain, run, options, processes);
  run.most_vertices = most_vertices(domain);
  if (options.resolved.align != Alignment::kOff && !plan.ray_geometry)
    run.memory_bytes =
        std::max(run.memory_bytes, memory_of_alignment(series, plan, run, options, processes));
  if (options.makes_halves()) {
    require_views_for_halves(plan, options);
    run.num_fits = 2;
    run.memory_bytes = std::max(run.memory_bytes, memory_of_halves(series, plan, domain, options));
  }
  return run;
}

void require_memory(const RunPlan& plan, const distributed::Communicator& processes) {
  base::require_memory(plan.memory_bytes * static_cast<std::size_t>(processes.size_on_machine()),
                       "this reconstruction",
                       "use a larger --bin or --vertex-spacing, a smaller --roi or --thickness, or "
                       "fewer --threads");
}

void require_few_vertices(const RunPlan& plan) {
  if (plan.most_vertices <= field::LeafShape::kMaxVertices) return;
  throw Error(fmt::format(
      "{} vertices along an axis of a leaf are more than {}: use a larger --vertex-spacing or "
      "--bin, or a smaller --thickness",
      plan.most_vertices, field::LeafShape::kMaxVertices));
}

}  // namespace tomofield::reconstruction
