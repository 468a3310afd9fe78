#include "exchange/alignment_output.h"

#include "base/check.h"
#include "exchange/relion_alignment.h"
#include "io/saving/output_files.h"
#include "output/alignment_files.h"
#include "output/output_paths.h"
#include "report/alignment_plot.h"
#include "tilt_series/planned_series.h"
#include "tomofield/error.h"

namespace tomofield::exchange {

std::vector<std::filesystem::path> alignment_results(const options::ReconstructOptions& options) {
  if (options.run.align == Alignment::kOff) return {};
  std::vector<std::filesystem::path> files =
      output::alignment_files(output::output_paths(options.run.output).alignment_prefix).all();
  files.push_back(output::output_paths(options.run.output).alignment_picture);
  if (const auto star = relion_alignment(options)) files.push_back(*star);
  return files;
}

std::vector<io::OutputLock> claim_alignment(const options::ReconstructOptions& options) {
  if (options.run.output.empty())
    throw Error("-o '' names no file: give the name that the files of the alignment begin with");
  const std::filesystem::path record = output::output_paths(options.run.output).alignment;
  std::vector<std::filesystem::path> files = alignment_results(options);
  files.insert(files.begin(), record);
  return io::claim_outputs({record}, [&] {
    base::require_no_faults(options.faults());
    io::check_output_files(files, io::input_files(options.files), options.run.overwrite,
                           "give --overwrite to replace it, or another name with -o");
  });
}

void write_alignment_results(const tilt_series::PlannedSeries& series,
                             const options::ReconstructOptions& options) {
  if (options.run.align == Alignment::kOff) return;
  const io::MrcHeader& header = series.stack().header();
  output::write_alignment_files(
      series, {header.nx, header.ny, header.nz},
      output::alignment_files(output::output_paths(options.run.output).alignment_prefix),
      output::tilt_axis(series, options.specimen).from_middle_px);
  report::write_alignment_picture(report::alignment_curves(*options.alignment),
                                  output::output_paths(options.run.output).alignment_picture);
  write_relion_alignment(series, options);
}

}  // namespace tomofield::exchange
