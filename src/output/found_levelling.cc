#include "output/found_levelling.h"

#include <fmt/format.h>

#include "io/is_file.h"
#include "io/json.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::output {

Levelling found_levelling(const std::filesystem::path& model) {
  constexpr const char* kAdvice = "give both angles in degrees: --level PITCH,X_TILT";
  constexpr double kLargest_deg = 90.0;
  const std::filesystem::path path = output_paths(model).alignment;
  if (!io::is_file(path)) {
    throw Error(
        fmt::format("there is no '{}' beside '{}', which --align writes, to level it by: {}",
                    path.string(), model.string(), kAdvice));
  }
  try {
    const nlohmann::json record = io::read_json(path);
    if (!record.is_object() || !record.contains("pose"))
      throw Error("the views could not tell the pitch");
    const nlohmann::json& pose = record.at("pose");
    Levelling found{.pitch_deg = io::number_at(pose, "pitch_deg", -kLargest_deg, kLargest_deg)};
    if (pose.contains("x_tilt_deg"))
      found.x_tilt_deg = io::number_at(pose, "x_tilt_deg", -kLargest_deg, kLargest_deg);
    return found;
  } catch (const std::exception& error) {
    throw Error(fmt::format("'{}' does not tell how to level the specimen: {}; {}", path.string(),
                            error.what(), kAdvice));
  }
}

}  // namespace tomofield::output
