#include "reconstruct/result_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "io/atomic_file.h"
#include "tomofield/error.h"

namespace tomofield::reconstruct {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> input_files(const tilt_series::TiltSeriesOptions& input) {
  std::vector<fs::path> files{input.stack};
  for (const auto& file :
       {input.tlt, input.xf, input.xtilt, input.aln, input.mdoc, input.fiducials, input.mask}) {
    if (file) files.push_back(*file);
  }
  return files;
}

}  // namespace

void check_result_files(std::vector<fs::path> results, const fs::path& picture_prefix,
                        const tilt_series::TiltSeriesOptions& input, bool may_replace,
                        const std::string& advice) {
  for (const char* picture : {"_xy.png", "_xz.png", "_yz.png", "_mask.png"})
    results.emplace_back(picture_prefix.string() + picture);
  for (auto it = results.begin(); it != results.end(); ++it) {
    if (std::find(it + 1, results.end(), *it) != results.end()) {
      throw Error(fmt::format(
          "the volume and another result would both be '{}': end the name after -o in .mrc",
          it->string()));
    }
    for (const fs::path& file : input_files(input)) {
      std::error_code absent;
      if (!fs::equivalent(*it, file, absent)) continue;
      throw Error(fmt::format(
          "the result '{}' would replace the input '{}': give another name or directory with -o",
          it->string(), file.string()));
    }
  }
  const io::AtomicFile probe(results.front());
  if (may_replace) return;
  for (const fs::path& result : results) {
    if (fs::exists(result)) throw Error(fmt::format("'{}' exists: {}", result.string(), advice));
  }
}

}  // namespace tomofield::reconstruct
