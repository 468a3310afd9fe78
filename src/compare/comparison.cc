#include "compare/comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "base/log.h"
#include "compare/comparison_record.h"
#include "compare/folder.h"
#include "compare/grid.h"
#include "compare/pictures.h"
#include "compare/runs.h"
#include "compare/scores.h"
#include "compare/table.h"
#include "evaluate/box.h"
#include "evaluate/profile.h"
#include "io/images/mrc.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_folder.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "report/contrast.h"
#include "report/curve_plot.h"
#include "report/html.h"
#include "report/pictures.h"
#include "tilt_series/measured_series.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"
#include "tomofield/options.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

// Returns the volumes that are shown side by side: the truth, if it has their size, and every
// volume. The first decides the grey scale and the detail.
std::vector<Shown> shown_volumes(const std::vector<Row>& rows,
                                 const std::optional<fs::path>& truth) {
  std::vector<Shown> shown;
  for (const Row& row : rows)
    shown.push_back({row.run.name, row.run.method.title, report::read_central_slices(row.volume)});
  if (!truth) return shown;
  Shown reference{"truth", "truth", report::read_central_slices(*truth)};
  const auto same_size = [](const report::Slice& a, const report::Slice& b) {
    return a.width == b.width && a.height == b.height;
  };
  if (std::ranges::equal(reference.planes, shown.front().planes, same_size))
    shown.insert(shown.begin(), std::move(reference));
  return shown;
}

// The densities of all volumes along one line.
struct Profiles {
  evaluate::LineSegment line;
  double voxel_A = 0;  // 0 if not known
  std::vector<evaluate::ProfileColumn> columns;
};

// Samples the volumes along the line that is given, or along x through the detail. The truth goes
// last if it has their size, so that methods keep the colours of the plots without a truth.
Profiles profiles_of(const CompareOptions& options, const std::vector<Row>& rows,
                     const Rectangle& detail) {
  const Grid grid = read_grid(rows.front().volume);
  Profiles profiles{.line = options.profile ? *options.profile : line_through(detail, grid.size[2]),
                    .voxel_A = grid.voxel_A,
                    .columns = {}};
  const auto add = [&](const std::string& name, const fs::path& path) {
    const base::Volume volume = evaluate::read_volume(path);
    profiles.columns.push_back(
        {name, evaluate::line_profile(volume, evaluate::whole_box(volume.shape), profiles.line)});
  };
  for (const Row& row : rows) add(row.run.name, row.volume);
  if (options.truth && read_grid(*options.truth).size == grid.size) add("truth", *options.truth);
  return profiles;
}

void add_profiles(const std::vector<Row>& rows, const Profiles& profiles, report::HtmlPage& page) {
  const auto& [line, voxel_A, columns] = profiles;
  page.add_heading("Profile");
  page.add_paragraph(fmt::format(
      "Density from {:g}, {:g}, {:g} to {:g}, {:g}, {:g} (voxels), in the file's units; "
      "profile.csv has the numbers.",
      line.from[0], line.from[1], line.from[2], line.to[0], line.to[1], line.to[2]));
  const double step = voxel_A > 0 ? voxel_A : 1.0;
  std::vector<report::Curve> curves;
  for (std::size_t column = 0; column < columns.size(); ++column) {
    const auto& [name, values] = columns[column];
    curves.push_back({column < rows.size() ? rows[column].run.method.title : name, {}});
    for (std::size_t i = 0; i < values.size(); ++i)
      curves.back().points.emplace_back(static_cast<double>(i) * step, values[i]);
  }
  page.add_svg(report::curve_plot_svg(
      {.x_title = voxel_A > 0 ? "distance, Å" : "distance, voxels", .y_title = "density"}, curves));
}

// Returns the part of the central planes that is enlarged, which the main method does not choose.
Rectangle chosen_detail(const std::vector<Row>& rows) {
  return busiest_detail(report::read_central_slices(rows[reference_row(rows)].volume).front());
}

void add_pictures(const CompareOptions& options, const std::vector<Row>& rows,
                  const Rectangle& detail, report::HtmlPage& page) {
  const fs::path folder = options.folder / "pictures";
  fs::create_directories(folder);
  const std::vector<Shown> shown = shown_volumes(rows, options.truth);
  const bool begins_with_truth = options.truth && shown.size() > rows.size();
  const report::GreyScale scale(
      report::contrast_of(io::MrcReader(begins_with_truth ? *options.truth : rows.front().volume)));
  page.add_heading("Central slices");
  page.add_paragraph(
      "All slices and details share one grey scale: that of the middle of the first volume.");
  for (std::size_t plane = 0; plane < 3; ++plane) {
    page.add_paragraph(std::array{"XY", "XZ", "YZ"}[plane]);
    page.add_figures(plane_figures(shown, plane, scale, folder));
  }
  page.add_heading("Detail");
  page.add_paragraph(
      fmt::format("The detail lies where the XY slice of {} varies most: x {} to {}, y {} to {}.",
                  rows[reference_row(rows)].run.method.title, detail.x0, detail.x1 - 1, detail.y0,
                  detail.y1 - 1));
  page.add_figures(detail_figures(shown, detail, scale, folder));
}

void add_commands(const std::vector<Row>& rows, report::HtmlPage& page) {
  std::string listing;
  for (const Row& row : rows) {
    std::vector<std::string> words = row.run.command;
    words.insert(words.end(), {"-o", row.volume.filename().string()});
    listing += shell_command(words) + "\n";
  }
  page.add_heading("Commands");
  page.add_listing(listing);
}

// Adds the shell correlations over spatial frequency.
void add_correlations(const Scores& scores, report::HtmlPage& page) {
  for (const auto& [title, curves] : scores.correlations) {
    page.add_heading(title);
    const double highest = curves.front().points.back().first;
    page.add_svg(report::curve_plot_svg(report::fsc_axes(highest), curves));
  }
}

std::string report_page(const CompareOptions& options, const std::vector<Row>& rows,
                        const Table& table, const Scores& scores, const Rectangle& detail,
                        const Profiles& profiles) {
  report::HtmlPage page("Comparison: " + options.files.stack.filename().string());
  page.add_paragraph(fmt::format(
      "tomofield {}; {} methods on {}. The main method is {}; bold is the best of a column, an "
      "orange cell is better than the main method's.",
      TOMOFIELD_VERSION, rows.size(), options.files.stack.string(), rows.front().run.method.title));
  page.add_table(table_cells(table));
  page.add_paragraph(scores.remark);
  add_pictures(options, rows, detail, page);
  add_profiles(rows, profiles, page);
  add_correlations(scores, page);
  add_commands(rows, page);
  return page.document();
}

ComparisonRecord record_of(const CompareOptions& options, const std::vector<Row>& rows,
                           Table table) {
  ComparisonRecord record{.series = options.files.stack,
                          .truth = options.truth,
                          .commands = {},
                          .volumes = {},
                          .table = std::move(table)};
  for (const Row& row : rows) {
    record.commands.push_back(row.run.command);
    record.volumes.push_back(row.volume);
  }
  return record;
}

// Warns of beads that a method with trials may mask, and that methods without trials keep.
void warn_of_undecided_beads(const tilt_series::MeasuredSeries& series) {
  const tilt_series::MaskMetrics& masks = series.mask_metrics();
  if (masks.bead_masking != tilt_series::BeadMasking::kUndecided) return;
  base::log_warning(fmt::format(
      "methods may treat the {} of this bright series differently, so that they count on other "
      "pixels: trials decide whether tomofield masks them, and baselines keep them. Give "
      "--bead-diameter {:.3g} to mask them for all methods, or --bead-diameter 0",
      describe_beads(masks), masks.bead_diameter_A / 10));
}

}  // namespace

void check_comparison(const CompareOptions& options) {
  if (options.methods.empty()) throw Error("a comparison needs a method: give --methods or --also");
  if (!fs::exists(options.files.stack))
    throw Error(fmt::format("the series '{}' does not exist", options.files.stack.string()));
  if (options.truth) io::MrcReader{*options.truth};
}

Outcome compare_methods(const CompareOptions& options, const RunHooks& hooks) {
  // Broken views are found before the runs, which read them.
  const tilt_series::MeasuredSeries series(
      tilt_series::series_options(options.files, options.series));
  warn_of_undecided_beads(series);
  const PlannedRuns plan = plan_runs(options, series);
  const io::OutputFolder folder(options.folder);
  const io::OutputLock lock(options.folder / "comparison.json");
  std::vector<Row> rows = options.overwrite ? new_rows(plan.runs, options.folder)
                                            : stored_rows(plan.runs, options.folder);
  check_folder(options, rows);
  if (!rehearse(options, hooks, rows)) return Outcome::kStoppedBeforeRuns;
  if (options.overwrite) {
    remove_results(options, rows);
    warn_of_other_runs(options, rows);
    claim_rows(rows);
  }
  if (!run_rows(options.program, hooks, rows)) return Outcome::kStopped;
  const std::vector<Row> volumes(
      rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(options.methods.size()));
  Table table = table_of_costs(volumes);
  const Scores scores = add_scores(options, plan.purposes, rows, table);
  const Rectangle detail = chosen_detail(volumes);
  const Profiles profiles = profiles_of(options, volumes, detail);
  const std::string page = report_page(options, volumes, table, scores, detail, profiles);
  io::OutputSet results;
  write_comparison(options.folder / "comparison.json", record_of(options, volumes, table));
  io::write_text_file(options.folder / "comparison.csv", table_csv(table));
  io::write_text_file(options.folder / "profile.csv",
                      evaluate::profile_csv(profiles.line, profiles.voxel_A, profiles.columns));
  io::write_text_file(options.folder / "report.html", page);
  results.commit();
  return Outcome::kFinished;
}

}  // namespace tomofield::compare
