#include "output/result_files.h"

#include "io/output_files.h"

namespace tomofield::output {

namespace fs = std::filesystem;

std::vector<fs::path> input_files(const SeriesFiles& input) {
  std::vector<fs::path> files{input.stack};
  for (const auto& file :
       {input.tlt, input.xf, input.xtilt, input.aln, input.mdoc, input.fiducials, input.mask}) {
    if (file) files.push_back(*file);
  }
  return files;
}

void check_result_files(std::vector<fs::path> results, const fs::path& picture_prefix,
                        const SeriesFiles& input, bool may_replace, const std::string& advice) {
  for (const char* picture : {"_xy.png", "_xz.png", "_yz.png", "_mask.png"})
    results.emplace_back(picture_prefix.string() + picture);
  io::check_output_files(results, input_files(input), may_replace, advice);
}

}  // namespace tomofield::output
