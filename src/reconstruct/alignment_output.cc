#include "reconstruct/alignment_output.h"

#include <cmath>

#include "base/check.h"
#include "io/output_files.h"
#include "output/alignment_files.h"
#include "reconstruct/relion_alignment.h"
#include "report/alignment_plot.h"
#include "tilt_series/open_views.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

std::filesystem::path prefix_of(const ReconstructOptions& options) {
  return output_paths(options.resolved.output).alignment.replace_extension();
}

std::filesystem::path picture_of(const ReconstructOptions& options) {
  return output_paths(options.resolved.output).alignment.replace_extension(".png");
}

// Returns the root mean square of the displacements [row][column] = (x, y) of the nodes.
double rms_of(const nlohmann::json& nodes) {
  double squares = 0.0, count = 0.0;
  for (const nlohmann::json& row : nodes) {
    for (const nlohmann::json& node : row) {
      squares += std::pow(node[0].get<double>(), 2) + std::pow(node[1].get<double>(), 2);
      count += 1.0;
    }
  }
  return std::sqrt(squares / count);
}

report::AlignmentCurves curves_of(const nlohmann::json& record) {
  report::AlignmentCurves curves;
  for (const nlohmann::json& view : record["views"]) {
    curves.tilt_deg.push_back(view["tilt_deg"]);
    curves.shift_x_px.push_back(view["shift_px"][0]);
    curves.shift_y_px.push_back(view["shift_px"][1]);
    curves.rotation_deg.push_back(view["rotation_deg"]);
    curves.magnification_percent.push_back(100 *
                                           std::expm1(view["log_magnification"].get<double>()));
    curves.tilt_change_deg.push_back(view["tilt_change_deg"]);
    curves.local_px.push_back(view.contains("local_px") ? rms_of(view["local_px"]) : 0.0);
    curves.correlation.push_back(view["correlation"]);
    curves.error_x_px.push_back(view["shift_error_px"][0]);
    curves.error_y_px.push_back(view["shift_error_px"][1]);
  }
  return curves;
}

}  // namespace

std::vector<std::filesystem::path> alignment_results(const ReconstructOptions& options) {
  if (options.resolved.align == Alignment::kOff) return {};
  std::vector<std::filesystem::path> files = output::alignment_files(prefix_of(options)).all();
  files.push_back(picture_of(options));
  if (const auto star = relion_alignment(options)) files.push_back(*star);
  return files;
}

std::vector<io::OutputLock> claim_alignment(const ReconstructOptions& options) {
  if (options.resolved.output.empty())
    throw Error("-o '' names no file: give the name that the files of the alignment begin with");
  const std::filesystem::path record = output_paths(options.resolved.output).alignment;
  std::vector<std::filesystem::path> files = alignment_results(options);
  files.insert(files.begin(), record);
  return io::claim_outputs({record}, [&] {
    base::require_no_faults(options.faults());
    io::check_output_files(files, io::input_files(options.files), options.resolved.overwrite,
                           "give --overwrite to replace it, or another name with -o");
  });
}

void write_alignment_results(const tilt_series::TiltSeries& series,
                             const ReconstructOptions& options) {
  if (options.resolved.align == Alignment::kOff) return;
  const auto stack = tilt_series::open_views(options.input);
  const io::MrcHeader& header = stack->header();
  output::write_alignment_files(series, {header.nx, header.ny, header.nz},
                                output::alignment_files(prefix_of(options)));
  report::write_alignment_picture(curves_of(options.alignment), picture_of(options));
  write_relion_alignment(series, options);
}

std::vector<report::CurvePlot> alignment_plots(const nlohmann::json& record) {
  return report::alignment_plots(curves_of(record));
}

}  // namespace tomofield::reconstruction
