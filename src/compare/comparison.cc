#include "compare/comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "base/utf8.h"
#include "compare/folder.h"
#include "compare/pictures.h"
#include "compare/runs.h"
#include "compare/scores.h"
#include "compare/table.h"
#include "io/atomic_file.h"
#include "io/json.h"
#include "io/mrc.h"
#include "io/output_folder.h"
#include "io/output_lock.h"
#include "io/output_set.h"
#include "output/shared_options.h"
#include "report/html.h"
#include "report/pictures.h"
#include "tilt_series/tilt_series.h"
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

void add_pictures(const CompareOptions& options, const std::vector<Row>& rows,
                  report::HtmlPage& page) {
  const fs::path folder = options.folder / "pictures";
  fs::create_directories(folder);
  const std::vector<Shown> shown = shown_volumes(rows, options.truth);
  const report::GreyScale scale = report::grey_scale_of(shown.front().planes);
  const Rectangle detail = busiest_detail(shown.front().planes.front());
  page.add_heading("Central slices");
  page.add_paragraph(
      "All slices and details share one grey scale: the 0.5 to 99.5 percentiles of the first "
      "volume.");
  for (std::size_t plane = 0; plane < 3; ++plane) {
    page.add_paragraph(std::array{"XY", "XZ", "YZ"}[plane]);
    page.add_figures(plane_figures(shown, plane, scale, folder));
  }
  page.add_heading("Detail");
  page.add_paragraph(
      fmt::format("The detail lies where the XY slice varies most: x {} to {}, y {} to {}.",
                  detail.x0, detail.x1 - 1, detail.y0, detail.y1 - 1));
  page.add_figures(detail_figures(shown, detail, scale, folder));
  const double voxel_A = io::MrcReader(rows.front().volume).header().voxel_size_A[0];
  page.add_heading("Profile");
  page.add_paragraph("Density along x through the middle of the detail, in the file's units.");
  std::vector<report::Curve> profiles = detail_profiles(shown, detail, voxel_A);
  // The truth goes last, so that methods keep the colours of the plots without a truth.
  std::rotate(profiles.begin(),
              profiles.begin() + static_cast<std::ptrdiff_t>(shown.size() - rows.size()),
              profiles.end());
  page.add_svg(report::curve_plot_svg(
      {.x_title = voxel_A > 0 ? "distance, Å" : "distance, voxels", .y_title = "density"},
      profiles));
}

void add_commands(const std::vector<Row>& rows, report::HtmlPage& page) {
  std::string listing;
  for (const Row& row : rows) {
    listing += fmt::format("tomofield {} -o {}\n", fmt::join(row.run.command, " "),
                           row.volume.filename().string());
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
                        const Table& table, const Scores& scores) {
  report::HtmlPage page("Comparison: " + options.files.stack.filename().string());
  page.add_paragraph(fmt::format(
      "tomofield {}; {} methods on {}. The main method is {}; bold is the best of a column, an "
      "orange cell is better than the main method's.",
      TOMOFIELD_VERSION, rows.size(), options.files.stack.string(), rows.front().run.method.title));
  page.add_table(table_cells(table));
  page.add_paragraph(scores.remark);
  add_pictures(options, rows, page);
  add_correlations(scores, page);
  add_commands(rows, page);
  return page.document();
}

nlohmann::json comparison_json(const CompareOptions& options, const std::vector<Row>& rows,
                               const Table& table) {
  nlohmann::json methods = table_json(table);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    methods[i]["command"] = utf8_texts(rows[i].run.command);
    methods[i]["volume"] = base::utf8_text(rows[i].volume.string());
  }
  return {
      {"tomofield", TOMOFIELD_VERSION},
      {"series", base::utf8_text(options.files.stack.string())},
      {"truth", options.truth ? nlohmann::json(base::utf8_text(options.truth->string())) : nullptr},
      {"methods", methods}};
}

}  // namespace

void check_comparison(const CompareOptions& options) {
  if (options.methods.empty()) throw Error("a comparison needs a method: give --methods or --also");
  if (!fs::exists(options.files.stack))
    throw Error(fmt::format("the series '{}' does not exist", options.files.stack.string()));
  if (options.truth) io::MrcReader{*options.truth};
}

Outcome compare_methods(const CompareOptions& options, const RunHooks& hooks) {
  tilt_series::TiltSeriesOptions checked = output::series_options(options.files, options.series);
  checked.keep_views = false;  // the runs read them
  const tilt_series::TiltSeries series(checked);
  const PlannedRuns plan = plan_runs(options, series);
  const io::OutputFolder folder(options.folder);
  const io::OutputLock lock(options.folder / "comparison.json");
  std::vector<Row> rows = options.overwrite ? new_rows(plan.runs, options.folder)
                                            : stored_rows(plan.runs, options.folder);
  check_folder(options, rows);
  if (!rehearse(options, hooks, rows)) return Outcome::kStoppedBeforeRuns;
  if (options.overwrite) remove_results(options, rows);
  if (!run_rows(options.program, hooks, rows)) return Outcome::kStopped;
  const std::vector<Row> volumes(
      rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(options.methods.size()));
  Table table = table_of_costs(volumes);
  const Scores scores = add_scores(options, plan.purposes, rows, table);
  const std::string page = report_page(options, volumes, table, scores);
  io::OutputSet results;
  io::write_json(options.folder / "comparison.json", comparison_json(options, volumes, table));
  io::write_text_file(options.folder / "comparison.csv", table_csv(table));
  io::write_text_file(options.folder / "report.html", page);
  results.commit();
  return Outcome::kFinished;
}

}  // namespace tomofield::compare
