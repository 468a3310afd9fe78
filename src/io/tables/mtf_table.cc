#include "io/tables/mtf_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/tables/star_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// Some tables rise a little above 1 at low frequencies, where noise limits their measurement.
constexpr double kLargestValue = 1.5;
constexpr double kLargestFrequency = 1.0;  // some tables go beyond ½

}  // namespace

MtfTable read_mtf(const std::filesystem::path& path) {
  const std::vector<StarTable> tables = read_star_file(path);
  const StarTable* const table = find_only_table(path, tables, "rlnMtfValue");
  if (table == nullptr) {
    throw Error(
        fmt::format("'{}' has no column _rlnMtfValue: give the detector's transfer function as "
                    "RELION takes it, with the columns _rlnResolutionInversePixel and "
                    "_rlnMtfValue",
                    path.string()));
  }
  MtfTable mtf;
  for (std::size_t i = 0; i < table->num_rows(); ++i) {
    const StarRow row(path, *table, i);
    const double frequency = row.number("rlnResolutionInversePixel", kLargestFrequency);
    const double value = row.number("rlnMtfValue", kLargestValue);
    const double last = mtf.frequencies.empty() ? -1.0 : mtf.frequencies.back();
    if (frequency < 0.0 || value < 0.0 || frequency <= last) {
      throw Error(fmt::format(
          "'{}', row {}: a frequency of {} cycles per pixel with a value of {} cannot be: "
          "frequencies must rise from 0, and no value is below 0",
          path.string(), i + 1, frequency, value));
    }
    mtf.frequencies.push_back(frequency);
    mtf.values.push_back(value);
  }
  if (mtf.values.size() < 2)
    throw Error(fmt::format("'{}' has fewer than two frequencies", path.string()));
  if (std::ranges::all_of(mtf.values, [](double value) { return value == 0.0; }))
    throw Error(
        fmt::format("'{}' has no value above 0: such a detector sees nothing", path.string()));
  return mtf;
}

}  // namespace tomofield::io
