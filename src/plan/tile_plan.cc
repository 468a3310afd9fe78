#include "plan/tile_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "base/system/memory.h"
#include "checkpoint/checkpoint.h"
#include "compact/budget.h"
#include "measurement/slab_views.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::plan {
namespace {

// Bytes of codes for each vertex of a fit (docs/results/compact.md, A 256 with 0.1dB).
constexpr double kCodesOfAVertex = 0.13;

// A coarse stage is fitted for the whole region if it has no more vertices than this number of
// bands.
constexpr int kBandsOfCoarse = 6;

// Not all of the memory that is free now stays free.
constexpr double kUsablePart = 0.9;

double vertices_of(const std::vector<field::LeafShape>& shapes) {
  return static_cast<double>(field::count_parameters(FieldKind::kGrid, shapes));
}

// Returns the domain with the vertices of a coarse stage.
fit::Domain coarse_domain(const fit::Domain& domain, int bin) {
  fit::Domain coarse = domain;
  coarse.shapes = domain.shapes_in(domain.tree, bin);
  return coarse;
}

// Returns how many stages are fitted for the whole region: at least the first one, which gives all
// tiles a common start. Returns 0 if there is no coarse stage.
int num_whole_stages(const fit::Domain& domain, const std::vector<fit::Stage>& stages) {
  const double most = vertices_of(domain.shapes) * kBandsOfCoarse / domain.tree.roots().rows;
  int count = 0;
  for (const fit::Stage& stage : stages) {
    if (stage.bin == 1) break;
    if (count > 0 && vertices_of(domain.shapes_in(domain.tree, stage.bin)) > most) break;
    ++count;
  }
  return count;
}

// Returns the bytes of the codes of all tiles.
double code_bytes(const PlannedFit& planned) {
  const compact::Budget budget = compact::parse_budget(planned.options.field.budget);
  if (budget.kind == compact::Budget::Kind::kDecibels)
    return kCodesOfAVertex * vertices_of(planned.domain.shapes);
  return budget.amount;
}

// Returns the peak memory: that of the fit of the coarse stages, or of the fit of a tile beside the
// vertices of the coarse stages.
std::size_t memory_of_tiles(const PlannedFit& planned, const fit::Domain& coarse,
                            const TilePlan& tiles) {
  const auto& [series, plan, domain, options, processes] = planned;
  const std::vector<fit::Stage> stages = fit::make_stages(options.field, options.fit);
  const auto split = stages.begin() + tiles.num_whole_stages;
  const std::size_t of_coarse =
      estimate_memory({series, plan, coarse, options, processes}, {stages.begin(), split});
  measurement::Measurement strip = plan;
  strip.roi.y1 = std::min(plan.roi.y1, plan.roi.y0 + tiles.rows + 2 * tiles.overlap);
  const fit::Domain of_strip = fit::make_domain(strip.geometry, strip.roi, options.field);
  const double kept = static_cast<double>(sizeof(float)) * vertices_of(coarse.shapes) +
                      2 * code_bytes(planned);  // twice while they are written or joined
  const std::size_t of_tile =
      estimate_memory({series, strip, of_strip, options, processes}, {split, stages.end()}) +
      measurement::SlabViews::resident_memory(plan.rays_shape(), 0) +
      static_cast<std::size_t>(kept);
  return std::max(of_coarse, of_tile);
}

// Returns a sentence if the region cannot be fitted by tiles.
const char* fault_of_tiles(const PlannedFit& planned) {
  const options::ReconstructOptions& options = planned.options;
  if (options.fit.engine == Engine::kRay || planned.plan.ray_geometry)
    return "--tile-rows needs --engine slab, whose rays stay in their row";
  if (options.filters_views())
    return "--tile-rows cannot filter views across tiles: leave out --ctf, --defocus, "
           "--dose-per-tilt, --mtf and --noise-model coloured";
  if (options.field.tree == TreeKind::kAdaptive)
    return "--tile-rows needs --tree uniform: one tree cannot be chosen tile by tile";
  if (options.fit.patience > 0)
    return "--tile-rows fits tiles of the same length: leave --early-stop out";
  if (options.fit.fourier > 0) return "--ifp needs the whole region: leave --tile-rows out";
  if (num_whole_stages(planned.domain, fit::make_stages(options.field, options.fit)) == 0)
    return "--tile-rows needs coarse stages, which all tiles start from: take --coarse-epochs "
           "above 0 and a --leaf-size of 64 or a multiple";
  return nullptr;
}

TilePlan tiles_of_rows(const PlannedFit& planned, std::int64_t rows) {
  const std::int64_t band = planned.domain.tree.roots().cell_size;
  TilePlan tiles;
  const auto stages = fit::make_stages(planned.options.field, planned.options.fit);
  tiles.num_whole_stages = num_whole_stages(planned.domain, stages);
  tiles.num_rows = static_cast<int>(planned.plan.roi.height());
  tiles.rows = static_cast<int>((rows + band - 1) / band * band);
  tiles.overlap = static_cast<int>(band);
  const fit::Domain coarse = coarse_domain(
      planned.domain, stages[static_cast<std::size_t>(tiles.num_whole_stages) - 1].bin);
  tiles.coarse_parameters = field::count_parameters(FieldKind::kGrid, coarse.shapes);
  tiles.memory_bytes = memory_of_tiles(planned, coarse, tiles);
  return tiles;
}

// Returns the tiles that the memory which is free now is enough for.
TilePlan tiles_for_memory(const PlannedFit& planned) {
  const auto stages = fit::make_stages(planned.options.field, planned.options.fit);
  const std::size_t free = base::available_memory();
  if (free == 0 || estimate_memory(planned, stages) <= free) return {};
  const std::int64_t band = planned.domain.tree.roots().cell_size;
  std::int64_t rows = planned.plan.roi.height() / band * band;
  TilePlan tiles = tiles_of_rows(planned, rows);
  while (rows > band &&
         static_cast<double>(tiles.memory_bytes) > kUsablePart * static_cast<double>(free))
    tiles = tiles_of_rows(planned, rows -= band);
  return tiles;
}

// Returns the rows of the tiles of the run that is resumed, if there is one (0: the whole region).
std::optional<int> rows_of_resumed_run(const options::ReconstructOptions& options) {
  std::optional<int> rows;
  if (!options.run.resume) return rows;
  const output::OutputPaths paths = output::output_paths(options.run.output);
  for (const std::filesystem::path& file : {paths.model, paths.tiles})
    if (!rows && std::filesystem::exists(file))
      checkpoint::read_checkpoint([&] { rows = checkpoint::stored_tile_rows(file); });
  return rows;
}

}  // namespace

std::vector<Tile> TilePlan::tiles_from(int first_row) const {
  std::vector<Tile> tiles;
  for (int first = first_row; first < num_rows; first += rows) {
    const int end = std::min(first + rows, num_rows);
    tiles.push_back(
        {{first, end}, {std::max(first - overlap, 0), std::min(end + overlap, num_rows)}});
  }
  return tiles;
}

double TilePlan::repeats() const {
  double fitted = 0;
  for (const Tile& tile : tiles_from(0)) fitted += tile.fitted.size();
  return fitted / num_rows;
}

TilePlan plan_tiles(const PlannedFit& planned) {
  const options::ReconstructOptions& options = planned.options;
  std::optional<int> rows;
  if (options.field.tile_rows.has_value()) rows = *options.field.tile_rows;
  if (rows == 0 || (!rows && options.field.budget.empty())) return {};
  if (const char* const fault = fault_of_tiles(planned)) {
    if (rows) throw Error(fault);
    return {};
  }
  if (!rows) rows = rows_of_resumed_run(options);
  if (!rows) return tiles_for_memory(planned);
  return *rows > 0 ? tiles_of_rows(planned, *rows) : TilePlan{};
}

}  // namespace tomofield::plan
