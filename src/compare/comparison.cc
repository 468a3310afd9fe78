#include "compare/comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <system_error>

#include "compare/pictures.h"
#include "compare/table.h"
#include "evaluate/compare.h"
#include "io/atomic_file.h"
#include "io/json.h"
#include "io/mrc.h"
#include "report/html.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

// PSNR and SSIM of every volume against the truth, as they are and after the best scale and offset.
void add_truth_scores(const std::vector<Row>& rows, const fs::path& truth, Table& table) {
  std::vector<std::optional<double>> psnr, affine_psnr, ssim, affine_ssim;
  for (const Row& row : rows) {
    const evaluate::Comparison scores = evaluate::compare_files(row.volume, truth, std::nullopt);
    psnr.push_back(scores.psnr.raw_dB);
    affine_psnr.push_back(scores.psnr.affine_dB);
    ssim.push_back(scores.ssim.raw);
    affine_ssim.push_back(scores.ssim.affine);
  }
  constexpr auto kHigher = Column::Better::kHigher;
  table.add({"psnr_dB", "PSNR, dB", kHigher, 2}, psnr);
  table.add({"psnr_affine_dB", "PSNR, scaled", kHigher, 2}, affine_psnr);
  table.add({"ssim", "SSIM", kHigher, 3}, ssim);
  table.add({"ssim_affine", "SSIM, scaled", kHigher, 3}, affine_ssim);
}

// What is shown side by side: the truth, if it has the size of the volumes, and every volume.
std::vector<Shown> shown_volumes(const std::vector<Row>& rows,
                                 const std::optional<fs::path>& truth) {
  std::vector<Shown> shown;
  for (const Row& row : rows)
    shown.push_back({row.method.name, row.method.title, report::read_central_slices(row.volume)});
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
  const std::size_t reference = 0;  // the truth, or the main method
  const Detail detail = busiest_detail(shown[reference].planes.front());
  page.add_heading("Central slices");
  page.add_paragraph("All on one grey scale: 0.5 to 99.5 percentiles of the first volume.");
  for (std::size_t plane = 0; plane < 3; ++plane) {
    page.add_paragraph(std::array{"XY", "XZ", "YZ"}[plane]);
    page.add_figures(plane_figures(shown, reference, plane, folder));
  }
  page.add_heading("Detail");
  page.add_paragraph(fmt::format("Where the XY slice varies most: x {} to {}, y {} to {}.",
                                 detail.x0, detail.x1 - 1, detail.y0, detail.y1 - 1));
  page.add_figures(detail_figures(shown, reference, detail, folder));
  const double voxel_A = io::MrcReader(rows.front().volume).header().voxel_size_A[0];
  page.add_heading("Profile");
  page.add_paragraph("Density along x through the middle of the detail, in the file's units.");
  page.add_svg(report::curve_plot_svg(
      {.x_title = voxel_A > 0 ? "distance, Å" : "distance, voxels", .y_title = "density"},
      detail_profiles(shown, detail, voxel_A)));
}

void add_commands(const std::vector<Row>& rows, report::HtmlPage& page) {
  std::string listing;
  for (const Row& row : rows) {
    listing += fmt::format("tomofield {} -o {}\n", fmt::join(row.command, " "),
                           row.volume.filename().string());
  }
  page.add_heading("Commands");
  page.add_listing(listing);
}

std::string report_page(const CompareOptions& options, const std::vector<Row>& rows,
                        const Table& table) {
  report::HtmlPage page("Comparison: " + options.series.stack.filename().string());
  page.add_paragraph(fmt::format(
      "tomofield {}; {} methods on {}. The main method is {}; bold is the best of a column, an "
      "orange cell is better than the main method's.",
      TOMOFIELD_VERSION, rows.size(), options.series.stack.string(), rows.front().method.title));
  page.add_table(table_cells(table));
  add_pictures(options, rows, page);
  add_commands(rows, page);
  return page.document();
}

nlohmann::json comparison_json(const CompareOptions& options, const std::vector<Row>& rows,
                               const Table& table) {
  nlohmann::json methods = table_json(table);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    methods[i]["command"] = rows[i].command;
    methods[i]["volume"] = rows[i].volume.string();
  }
  return {{"tomofield", TOMOFIELD_VERSION},
          {"series", options.series.stack.string()},
          {"truth", options.truth ? nlohmann::json(options.truth->string()) : nullptr},
          {"methods", methods}};
}

}  // namespace

void check_comparison(const CompareOptions& options) {
  if (options.methods.empty()) throw Error("a comparison needs a method: give --methods or --also");
  if (!fs::exists(options.series.stack))
    throw Error(fmt::format("the series '{}' does not exist", options.series.stack.string()));
  if (options.truth) io::MrcReader{*options.truth};
  std::error_code fault;
  fs::create_directories(options.folder, fault);
  if (fault || !fs::is_directory(options.folder)) {
    throw Error(fmt::format("the folder '{}' cannot be made{}", options.folder.string(),
                            fault ? ": " + fault.message() : ""));
  }
}

RowsOutcome compare_methods(const CompareOptions& options, const RunHooks& hooks) {
  std::vector<Row> rows;
  if (run_rows(options.program, options.series, options.methods, options.folder, options.tune,
               options.overwrite, hooks, rows) == RowsOutcome::kStopped)
    return RowsOutcome::kStopped;
  Table table = table_of_costs(rows);
  if (options.truth) add_truth_scores(rows, *options.truth, table);
  io::write_json(options.folder / "comparison.json", comparison_json(options, rows, table));
  io::write_text_file(options.folder / "comparison.csv", table_csv(table));
  io::write_text_file(options.folder / "report.html", report_page(options, rows, table));
  return RowsOutcome::kFinished;
}

}  // namespace tomofield::compare
