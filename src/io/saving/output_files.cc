#include "io/saving/output_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <system_error>

#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

std::vector<fs::path>& other_inputs() {
  static std::vector<fs::path> files;
  return files;
}

void require_no_input(const fs::path& result, const std::vector<fs::path>& inputs) {
  for (const fs::path& file : inputs) {
    std::error_code absent;
    if (!fs::equivalent(result, file, absent)) continue;
    throw Error(
        fmt::format("the result '{}' would replace the input '{}': give another name or directory",
                    result.string(), file.string()));
  }
}

}  // namespace

void add_input(const fs::path& file) { other_inputs().push_back(file); }

void require_no_input_is_replaced(const std::vector<fs::path>& results,
                                  const std::vector<fs::path>& inputs) {
  for (const fs::path& result : results) {
    require_no_input(result, inputs);
    require_no_input(result, other_inputs());
  }
}

void check_output_files(const std::vector<fs::path>& results, const std::vector<fs::path>& inputs,
                        bool may_replace, const std::string& advice) {
  for (auto it = results.begin(); it != results.end(); ++it) {
    if (std::find(it + 1, results.end(), *it) != results.end()) {
      throw Error(
          fmt::format("two results would both be '{}': give them different names (a volume's "
                      "ends in .mrc)",
                      it->string()));
    }
  }
  require_no_input_is_replaced(results, inputs);
  for (const fs::path& result : results) {
    if (!may_replace && fs::exists(result))
      throw Error(fmt::format("'{}' exists: {}", result.string(), advice));
    require_writable(result);
  }
}

void require_volume_name(const std::filesystem::path& volume) {
  std::string extension = volume.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const char* other : {".tif", ".tiff", ".h5", ".hdf", ".hdf5", ".em", ".dm4", ".nii", ".npy",
                            ".zarr", ".json", ".html", ".png", ".jpg", ".jpeg"})
    if (extension == other)
      throw Error(fmt::format(
          "the volume is an MRC file, and '{}' ends in {}: give a name in .mrc, .rec or .map",
          volume.string(), other));
}

std::vector<fs::path> input_files(const SeriesFiles& input) {
  std::vector<fs::path> files{input.stack};
  for (const auto& file : {input.tlt, input.xf, input.xtilt, input.aln, input.mdoc, input.fiducials,
                           input.mask, input.even, input.odd, input.ctf, input.mtf}) {
    if (file) files.push_back(*file);
  }
  return files;
}

void check_result_files(std::vector<fs::path> results, const fs::path& picture_prefix,
                        const SeriesFiles& input, bool may_replace, const std::string& advice) {
  for (const char* picture : {"_xy.png", "_xz.png", "_yz.png", "_mask.png"})
    results.emplace_back(picture_prefix.string() + picture);
  check_output_files(results, input_files(input), may_replace, advice);
}

}  // namespace tomofield::io
