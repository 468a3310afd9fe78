#include "reconstruct/tiled_run.h"

#include <fmt/format.h>

#include <cstdlib>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/progress.h"
#include "base/system/memory.h"
#include "base/trace.h"
#include "checkpoint/finished_tiles.h"
#include "compact/budget.h"
#include "compact/compress.h"
#include "compact/decoded_field.h"
#include "fit/fit.h"
#include "options/run_options.h"
#include "reconstruct/run_fit.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

// Holds the state in which the coarse stages have ended.
struct CoarseStart {
  fit::Progress progress;
  std::unique_ptr<field::Field> field;
  double variance = 0.0;  // of its densities
  double seconds = 0.0;
  double part_of_work = 0.0;  // of the coarse stages in that of the whole run
};

// Holds what is kept of the fit of the tile in the middle, which speaks for all of them.
struct Example {
  record::FitRecord found;
  std::optional<measurement::PredictedView> held_out_view;
  plan::Tile tile;
};

// Fits the coarse stages of the whole region. Returns nothing if the run was stopped.
std::optional<CoarseStart> fit_coarse_stages(const Run& run, const plan::TilePlan& plan,
                                             const FitOutcome& outcome) {
  const auto stages = fit::make_stages(run.options.field, run.options.fit);
  double work = 0, of_coarse = 0;
  for (const fit::Stage& stage : stages) {
    work += stage.epochs * stage.step_cost;
    if (&stage - stages.data() < plan.num_whole_stages) of_coarse += stage.epochs * stage.step_cost;
  }
  const base::ProgressSink progress =
      base::part_of(run.observer.fit, 0.0, of_coarse / work, "whole region");
  const FitJob job{.measurement = run.measurement,
                   .model = run.paths.model,
                   .origin = outcome.origin,
                   .resumes = run.options.run.resume,
                   .progress = progress,
                   .part = {.num_stages = plan.num_whole_stages}};
  const FitRun made = run_fit(run, job);
  if (made.was_stopped) return std::nullopt;
  if (made.took_steps && run.writes_files())
    checkpoint::save_checkpoint(run.paths.model, *made.fit,
                                checkpoint::model_info(run.measurement, run.options),
                                outcome.origin);
  const double variance = compact::variance_of(made.fit->field(), run.measurement.roi);
  return CoarseStart{.progress = made.fit->progress(),
                     .field = made.fit->take_field(),
                     .variance = variance,
                     .seconds = made.seconds,
                     .part_of_work = of_coarse / work};
}

// Fits one tile after the other.
class TileFits {
 public:
  TileFits(const Run& run, const FitOutcome& outcome, const CoarseStart& start, int num_rows,
           checkpoint::FinishedTiles& finished)
      : run_(run), outcome_(outcome), start_(start), num_rows_(num_rows), finished_(finished) {
    fit_options_.fit_view_scale = false;  // the coarse stages have found scales for all tiles
  }

  // Fits a tile for an example alone. Returns nothing if the run was stopped.
  std::optional<Example> fit_example(const plan::Tile& tile) const {
    const measurement::Measurement rays = rays_of(tile);
    const std::unique_ptr<fit::Fit> fit = fitted(tile, rays, "again, for the report, ");
    if (!fit) return std::nullopt;
    return example_of(tile, rays, *fit);
  }

  // Returns false if the run was stopped.
  bool fit(const plan::Tile& tile, std::optional<Example>* example) {
    const base::TraceSpan span("tile");
    const base::Stopwatch running;
    const measurement::Measurement rays = rays_of(tile);
    std::unique_ptr<fit::Fit> fit = fitted(tile, rays, "");
    if (!fit) return false;
    const double seconds_fitting = running.seconds();
    checkpoint::FinishedTile done{.rows = tile.own,
                                  .fitted_rows = tile.fitted,
                                  .residual = fit->progress().data_loss.back(),
                                  .seconds_fitting = seconds_fitting};
    if (!rays.held_out.empty())
      done.held_out_error = fit->held_out_error(run_.options.fit.fit_view_scale).total;
    if (example != nullptr) *example = example_of(tile, rays, *fit);
    std::unique_ptr<field::Field> vertices = fit->take_field();
    fit.reset();  // compression needs the memory
    const base::Stopwatch compressing;
    compact::CompactField made = compressed(tile, std::move(vertices));
    done.seconds_compressing = compressing.seconds();
    done.report = made.report;
    finished_.add(done, std::move(made.coded));
    return true;
  }

 private:
  measurement::Measurement rays_of(const plan::Tile& tile) const {
    std::vector<int> views(static_cast<std::size_t>(run_.measurement.geometry.num_views()));
    std::iota(views.begin(), views.end(), 0);
    return some_rows(run_.measurement, tile.fitted, views);
  }

  // Returns the fit of a tile, or nothing if the run was stopped. `why` begins what progress says.
  std::unique_ptr<fit::Fit> fitted(const plan::Tile& tile, const measurement::Measurement& rays,
                                   const char* why) const {
    auto fit = std::make_unique<fit::Fit>(rays, run_.options.field, fit_options_);
    fit->go_on_from_stages(start_.progress, *start_.field);
    if (!take_steps(tile, why, *fit)) return nullptr;
    fit->free_optimizer();  // the verdict needs the memory
    return fit;
  }

  Example example_of(const plan::Tile& tile, const measurement::Measurement& rays,
                     const fit::Fit& fit) const {
    record::FitRecord found = examine(fit, rays, run_, outcome_);
    auto view = central_held_out_view(fit, rays, found);
    return {std::move(found), std::move(view), tile};
  }

  // Takes the steps of a tile. Returns false if the run was stopped.
  bool take_steps(const plan::Tile& tile, const char* why, fit::Fit& fit) const {
    const double of_tiles = 1 - start_.part_of_work;
    const auto rows = static_cast<double>(num_rows_);
    const base::ProgressSink progress = base::part_of(
        run_.observer.fit, start_.part_of_work + of_tiles * tile.own.begin / rows,
        of_tiles * tile.own.size() / rows,
        fmt::format("{}rows {} to {} of {}", why, tile.own.begin, tile.own.end, num_rows_));
    const base::Stopwatch running;
    const double first = fit.work(fit.progress().step), all = fit.work(fit.num_steps()) - first;
    bool stopped = false;
    fit.run([&](const fit::Fit&) {
      const double done = (fit.work(fit.progress().step) - first) / all;
      if (progress) {
        const auto& loss = fit.progress().data_loss;
        progress(
            base::progress_at(done, running.seconds(), fmt::format("loss {:.4f}", loss.back())));
      }
      // A tile that is done is kept: the run stops in the next one.
      stopped = run_.observer.stop_requested && run_.observer.stop_requested() && !fit.is_done();
      return !stopped;
    });
    return !stopped;
  }

  // Replaces the own rows of a tile by codes, with the budget's share of these rows.
  compact::CompactField compressed(const plan::Tile& tile,
                                   std::unique_ptr<field::Field> vertices) const {
    compact::Budget budget = compact::parse_budget(run_.options.field.budget);
    if (budget.kind != compact::Budget::Kind::kDecibels)
      budget.amount *= static_cast<double>(tile.own.size()) / num_rows_;
    const auto first = static_cast<int>(run_.measurement.roi.y0);
    base::Range rows{first + tile.own.begin, first + tile.own.end};
    if (tile.own.end == num_rows_) {  // the last band may reach beyond the region
      const field::RootGrid& roots = vertices->tree().roots();
      rows.end = static_cast<int>(roots.y0 + roots.rows * roots.cell_size);
    }
    const output::ModelInfo info = checkpoint::model_info(run_.measurement, run_.options);
    return compact::compress(
        *vertices, run_.measurement.roi, budget, rows, start_.variance,
        [&](const compact::CodedField& coded) { return output::coded_file_size(coded, info); });
  }

  const Run& run_;
  const FitOutcome& outcome_;
  const CoarseStart& start_;
  int num_rows_;
  checkpoint::FinishedTiles& finished_;
  FitOptions fit_options_ = options::with_denoise(run_.options.fit);
};

// Returns the tile that is nearest to the middle of the region.
const plan::Tile& middle_tile(const std::vector<plan::Tile>& tiles, int num_rows) {
  const auto distance = [&](const plan::Tile& tile) {
    return std::abs(tile.own.begin + tile.own.end - num_rows);
  };
  return *std::ranges::min_element(tiles, {}, distance);
}

// Returns the record of the run: that of the example where it is of one fit, and that of all tiles.
record::RunRecord record_of_tiles(const Run& run, const Example& example,
                                  const checkpoint::FinishedTiles& finished, double seconds) {
  using checkpoint::FinishedTile;
  record::RunRecord record = run_record(run.options, example.found);
  record::FitMetrics& metrics = record.fit.metrics;
  metrics.width = run.measurement.roi.width();
  metrics.height = run.measurement.roi.height();
  metrics.thickness = run.measurement.geometry.thickness;
  metrics.seconds = seconds;
  metrics.num_leaves = finished.coded().tree.num_leaves();
  verdict::Verdict& verdict = record.fit.verdict;
  verdict.residual = finished.mean_of(&FinishedTile::residual);
  verdict.seconds = run.options.since_start.seconds();
  verdict.peak_GiB = static_cast<double>(base::peak_memory()) / (1 << 30);
  record.tiles = record::TilesRecord{example.tile.own, finished.tiles()};
  compact::require_likeness(finished.report());
  record.compact =
      record::CompactRecord{finished.report(), finished.sum_of(&FinishedTile::seconds_compressing)};
  return record;
}

// Writes the results of a run whose tiles are all finished.
RunResult finish_tiles(const Run& run, FitOutcome& outcome, checkpoint::FinishedTiles& finished,
                       Example example, double seconds_of_coarse) {
  outcome.seconds = seconds_of_coarse + finished.sum_of(&checkpoint::FinishedTile::seconds_fitting);
  RunResult result{.model = output::Model{checkpoint::model_info(run.measurement, run.options),
                                          nullptr, std::nullopt},
                   .record = record_of_tiles(run, example, finished, outcome.seconds)};
  result.model->coded = finished.take();
  if (!run.writes_files()) {
    result.model->field = compact::decode_field(*result.model->coded);
    return result;
  }
  io::OutputSet outputs;
  const output::TrainingState no_state;
  const output::VolumeShare share{
      run.processes, {0, static_cast<int>(run.measurement.roi.height())}, 0, 0};
  write_together({run, outcome.origin, no_state, share, example.held_out_view}, outputs, result);
  finished.remove_file();
  return result;
}

}  // namespace

RunResult fit_by_tiles(const Run& run, const plan::TilePlan& plan, FitOutcome& outcome) {
  const base::TraceSpan span("fit by tiles");
  const auto stopped = [&] {
    return RunResult{.outcome = Outcome::kStopped, .checkpoint = run.paths.model};
  };
  checkpoint::FinishedTiles finished(
      run.options, run.measurement,
      outcome.origin);  // refuses tiles of another run before any work
  const std::optional<CoarseStart> start = fit_coarse_stages(run, plan, outcome);
  if (!start) return stopped();
  const std::vector<plan::Tile> all = plan.tiles_from(0);
  const plan::Tile& middle = middle_tile(all, plan.num_rows);
  TileFits fits(run, outcome, *start, plan.num_rows, finished);
  std::optional<Example> example;
  if (middle.own.begin < finished.num_rows()) {  // an earlier session has finished it
    example = fits.fit_example(middle);
    if (!example) return stopped();
  }
  const std::vector<plan::Tile> tiles = plan.tiles_from(finished.num_rows());
  for (const plan::Tile& tile : tiles) {
    if (!fits.fit(tile, tile.own.begin == middle.own.begin ? &example : nullptr)) return stopped();
    if (&tile != &tiles.back()) finished.save();
  }
  return finish_tiles(run, outcome, finished, std::move(*example), start->seconds);
}

}  // namespace tomofield::reconstruction
