#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tomofield::projects {

/// Returns the stack that belongs to a file of another program, "TS.aln", "TS.mdoc" or
/// "TS.st.mdoc", beside it: "TS.st" for the last, else `named`, the name that the file states
/// (empty: none), else the name of the file with the extension of a stack. A tomogram of this
/// program is none of them. Returns nothing if there is no stack.
std::optional<std::filesystem::path> find_stack_beside(const std::filesystem::path& file,
                                                       const std::string& named);

}  // namespace tomofield::projects
