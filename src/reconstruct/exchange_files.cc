#include "reconstruct/exchange_files.h"

#include "base/trace.h"
#include "io/json.h"
#include "reconstruct/alignment_output.h"
#include "reconstruct/portal_alignment.h"
#include "reconstruct/relion_output.h"

namespace tomofield::reconstruction {

std::vector<std::filesystem::path> volume_descriptions(const ReconstructOptions& options) {
  std::vector<std::filesystem::path> files;
  if (const auto star = relion_output(options)) files.push_back(*star);
  if (options.resolved.alignment_json)
    files.push_back(portal_alignment_path(options.resolved.output));
  return files;
}

std::vector<std::filesystem::path> exchange_files(const ReconstructOptions& options) {
  std::vector<std::filesystem::path> files = volume_descriptions(options);
  for (const auto& file : alignment_results(options)) files.push_back(file);
  return files;
}

void write_exchange_files(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                          const std::filesystem::path& volume) {
  const base::TraceSpan span("write files for other programs");
  write_relion_output(options, volume);
  write_alignment_results(series, options);
  if (options.resolved.alignment_json) {
    io::write_json(portal_alignment_path(options.resolved.output),
                   portal_alignment(series, options, volume));
  }
}

}  // namespace tomofield::reconstruction
