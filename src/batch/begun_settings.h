#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tomofield::batch {

/// Returns true for the flags of the settings which the series of a batch share, as "--tv".
bool is_shared(std::string_view flag);

/// Returns the words of a command that give settings which the series of a batch share, as in
/// "--tv=5" (choice.h).
std::vector<std::string> shared_words(const std::vector<std::string>& command);

/// Returns these words of each series that the list of an earlier batch in this folder has, by its
/// name; without such a list none. Throws Error if the list is damaged.
std::map<std::string, std::vector<std::string>> begun_settings(const std::filesystem::path& folder);

}  // namespace tomofield::batch
