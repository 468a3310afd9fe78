#include "base/utf8.h"
#include "io/json.h"
#include "view/viewed_volume.h"

namespace tomofield::view {
namespace {

nlohmann::json description(const ViewedVolume& volume) {
  return {{"title", base::utf8_text(volume.title())},
          {"note", volume.note()},
          {"size", volume.size()},
          {"voxel_size_A", volume.voxel_size_A()},
          {"contrast", {volume.contrast().black, volume.contrast().white}}};
}

}  // namespace

std::string info_text(const std::vector<std::unique_ptr<ViewedVolume>>& volumes) {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& volume : volumes) all.push_back(description(*volume));
  return nlohmann::json{{"volumes", all}, {"largest_side_px", kLargestSide_px}}.dump();
}

}  // namespace tomofield::view
