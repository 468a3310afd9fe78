#include "batch/begun_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "batch/slurm.h"
#include "io/json.h"

namespace tomofield::batch {

using nlohmann::json;
namespace fs = std::filesystem;

std::vector<std::string> shared_words(const std::vector<std::string>& command) {
  std::vector<std::string> words;
  std::ranges::copy_if(command, std::back_inserter(words), [](const std::string& word) {
    return word.starts_with("--tv=") || word.starts_with("--tv-penalty=") ||
           word.starts_with("--spike-rank=") || word.starts_with("--prior=");
  });
  return words;
}

std::map<std::string, std::vector<std::string>> begun_settings(const fs::path& folder) {
  std::map<std::string, std::vector<std::string>> settings;
  const fs::path file = list_of(folder);
  if (!fs::exists(file)) return settings;
  const auto read = [&](const json& list) {
    for (const json& job : list.at("jobs"))
      settings[job.at("name").get<std::string>()] =
          shared_words(job.at("command").get<std::vector<std::string>>());
    return settings;
  };
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format(
        "'{}' is not the list of a batch ({}), which says with what its series have begun: remove "
        "it, and these series take the choice of this batch, or start over with --overwrite",
        file.string(), why);
  });
}

}  // namespace tomofield::batch
