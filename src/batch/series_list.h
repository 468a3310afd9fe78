#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/check.h"
#include "option_table/setting.h"

namespace tomofield::batch {

/// Throws Error if there is a mistake. Of several, logs each on a line of its own before.
void require_none(const base::Faults& mistakes);

/// The option that names one series of a project.
inline constexpr const char* kSeriesOption = "--series";

/// One series of a batch, as a table or a pattern names it.
struct Series {
  std::string name;              ///< of its files and in the summary
  std::string source;            ///< for messages: "line 3 of 'series.csv'"
  std::filesystem::path input;   ///< what `reconstruct` takes
  std::filesystem::path output;  ///< the tomogram; empty: NAME.mrc in the folder of the batch
  std::vector<option_table::GivenOption> options;  ///< of this series alone
  std::vector<std::string> left_out{};  ///< flags of the command line that it does not have
  bool is_tomogram = false;  ///< a row of RELION's table, whose name --series states as it is
};

/// A column of a table names an option of `reconstruct`, which a table may or may not set.
enum class ColumnKind {
  kUnknown,   ///< there is no such option
  kNotHere,   ///< the batch itself sets it
  kFlag,      ///< an option without a value
  kWithValue  ///< an option with a value
};
/// Returns the kind of an option, which is given by its flag, as in "--thickness".
using KindOfColumn = std::function<ColumnKind(const std::string& flag)>;
/// The options of `reconstruct` that a table may set.
struct KnownColumns {
  KindOfColumn kind_of;
  std::vector<std::string> names;  ///< without dashes, for suggestions
};

/// Reads a table: comma-separated values, or values separated by tabs if its name ends with .tsv.
/// Its first line names the columns. `stack` (or `path`) is the series, `name` and `output` may be
/// there, and any other column is an option of `reconstruct` without its dashes. An empty cell
/// means the default. Cells of flags are true, false or empty. Names have {name} and {folder}
/// filled in (placeholders.h). Adds every mistake with its line to `faults`, and leaves out the
/// series that have no stack. Throws Error if it cannot tell which columns there are.
std::vector<Series> read_table(const std::filesystem::path& path, const KnownColumns& known,
                               base::Faults& faults);

/// Returns the files and folders that a pattern of the shell names, in their order. A file gives
/// its series the name of the file without its ending. Those with the same name get that of their
/// folder before it. Throws Error if there are none.
std::vector<Series> expand_pattern(const std::string& pattern);

/// Returns the tomograms of RELION 5's tomograms.star, or of its list of tilt series, each as one
/// series of that file. A STAR file of anything else is one series. Throws Error if it is no STAR
/// file.
std::vector<Series> read_star(const std::filesystem::path& path);

/// Returns the name of a series without one of its own: that of its file without the ending, or of
/// its folder.
std::string series_name(const std::filesystem::path& input);

/// Adds every series whose name cannot be that of a file, and every name and output that two series
/// share. The outputs are there.
void check_names(const std::vector<Series>& all, base::Faults& faults);

}  // namespace tomofield::batch
