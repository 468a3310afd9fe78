#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "option_table/given_option.h"

namespace tomofield::batch {

/// One series of a batch, as a table or a pattern names it.
struct Series {
  std::string name;              ///< of its files and in the summary
  std::string source;            ///< for messages: "line 3 of 'series.csv'"
  std::filesystem::path input;   ///< what `reconstruct` takes
  std::filesystem::path output;  ///< the tomogram; empty: NAME.mrc in the folder of the batch
  std::vector<option_table::GivenOption> options;  ///< of this series alone
};

}  // namespace tomofield::batch
