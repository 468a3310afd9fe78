#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::io {

/// Adds a file that the program reads beside those of a series, as that of --config. It counts as
/// an input of everything that the process writes from then on.
void add_input(const std::filesystem::path& file);

/// Returns the files of add_input().
const std::vector<std::filesystem::path>& added_inputs();

/// Throws Error if a result, a file or a folder, would replace one of the `inputs` or of
/// add_input().
void require_no_input_is_replaced(const std::vector<std::filesystem::path>& results,
                                  const std::vector<std::filesystem::path>& inputs);

/// Throws Error if two results would be one file (file_identity.h).
void require_distinct(const std::vector<std::filesystem::path>& results);

/// Checks before any work that results can be written. Throws Error if two results would be one
/// file, if one would replace one of the `inputs` or of add_input() (even if it may replace
/// results), if one cannot be written at its place, or, unless `may_replace`, if one exists. In the
/// last case, `advice` tells the user what to do instead.
void check_output_files(const std::vector<std::filesystem::path>& results,
                        const std::vector<std::filesystem::path>& inputs, bool may_replace,
                        const std::string& advice);

/// Throws Error unless the name of an MRC volume has an extension of such volumes, or none. The
/// other results have it without its extension, so that a.1 and a.2 would share them.
void require_volume_name(const std::filesystem::path& volume);

/// Returns every file that a series is read from, with the images that a table or an .mdoc names.
std::vector<std::filesystem::path> input_files(const SeriesFiles& files);

}  // namespace tomofield::io
