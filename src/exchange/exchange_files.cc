#include "exchange/exchange_files.h"

#include "base/trace.h"
#include "exchange/alignment_output.h"
#include "exchange/portal_alignment_record.h"
#include "exchange/relion_output.h"
#include "io/tables/star_file.h"
#include "output/output_paths.h"

namespace tomofield::exchange {

std::vector<std::filesystem::path> volume_descriptions(const options::ReconstructOptions& options) {
  std::vector<std::filesystem::path> files;
  if (const auto star = relion_output(options)) files.push_back(*star);
  if (options.run.alignment_json)
    files.push_back(output::output_paths(options.run.output).portal_alignment);
  return files;
}

std::vector<std::filesystem::path> exchange_files(const options::ReconstructOptions& options) {
  std::vector<std::filesystem::path> files = volume_descriptions(options);
  for (const auto& file : alignment_results(options)) files.push_back(file);
  return files;
}

void check_exchange_files(const options::ReconstructOptions& options) {
  if (relion_output(options)) io::require_star_text(options.run.output.string());
}

void write_exchange_files(const tilt_series::PlannedSeries& series,
                          const options::ReconstructOptions& options,
                          const std::filesystem::path& volume) {
  const base::TraceSpan span("write files for other programs");
  write_relion_output(options, volume);
  write_alignment_results(series, options);
  if (options.run.alignment_json) write_portal_alignment(series, options, volume);
}

}  // namespace tomofield::exchange
