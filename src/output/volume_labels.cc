#include "output/volume_labels.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "tomofield/version.h"

namespace tomofield::output {
namespace {

// The keys of files among the resolved options (option_table/rows.cc), and what labels call them.
constexpr std::array<std::pair<const char*, const char*>, 6> kFiles{{{"stack", "series"},
                                                                     {"tlt", "angles"},
                                                                     {"xf", "alignment"},
                                                                     {"aln", "alignment"},
                                                                     {"xtilt", "x-axis tilts"},
                                                                     {"mdoc", "metadata"}}};

// Labels are ASCII (MRC2014).
std::string ascii_only(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) >= 0x80) c = '?';
  return text;
}

}  // namespace

std::vector<std::string> volume_labels(const ModelInfo& info, const std::string& made_by) {
  std::vector<std::string> labels{fmt::format("tomofield {}: {}", library_version(), made_by)};
  const auto options = nlohmann::json::parse(info.options_json, nullptr, false);
  if (!options.is_object() || !options.contains("input")) return labels;
  const nlohmann::json& input = options["input"];
  for (const auto& [key, what] : kFiles) {
    const auto file = input.find(key);
    if (file == input.end() || !file->is_string()) continue;
    const std::filesystem::path path = file->get<std::string>();
    labels.push_back(ascii_only(fmt::format("{}: {}", what, path.filename().string())));
  }
  return labels;
}

}  // namespace tomofield::output
