#include "output/model_input_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include "io/json.h"
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

ModelInput input_of(const ModelInfo& info) {
  ModelInput found;
  const auto options = nlohmann::json::parse(info.options_json, nullptr, false);
  const auto input = options.is_object() ? options.find("input") : options.end();
  if (input == options.end() || !input->is_object()) return found;
  for (const auto& entry : input->items()) {
    if (entry.value().is_string())
      found.files[entry.key()] = entry.value().get<std::string>();
    else if (entry.key() == "bin" && entry.value().is_number())
      found.bin = std::max(entry.value().get<double>(), 1.0);
  }
  return found;
}

VolumeAxes axes_of_tomogram(const ModelInfo& info) {
  const auto options = nlohmann::json::parse(info.options_json, nullptr, false);
  const nlohmann::json::json_pointer axes("/volume/axes");
  const bool is_xzy = options.is_object() && options.contains(axes) && options.at(axes) == "xzy";
  return is_xzy ? VolumeAxes::kXzy : VolumeAxes::kXyz;
}

std::vector<std::string> volume_labels(const ModelInfo& info, const std::string& made_by) {
  std::vector<std::string> labels{fmt::format("tomofield {}: {}", library_version(), made_by)};
  const ModelInput input = input_of(info);
  for (const auto& [key, what] : kFiles) {
    const auto file = input.files.find(key);
    if (file != input.files.end())
      labels.push_back(ascii_only(fmt::format("{}: {}", what, file->second.filename().string())));
  }
  return labels;
}

}  // namespace tomofield::output
