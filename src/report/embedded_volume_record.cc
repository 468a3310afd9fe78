#include <utility>

#include "io/json.h"
#include "report/embedded_volume.h"
#include "report/page_picture.h"

namespace tomofield::report {

std::string text_of(const EmbeddedVolume& volume) {
  nlohmann::json sheets = nlohmann::json::array();
  for (const std::string& sheet : volume.sheets) sheets.push_back(base64(sheet));
  const nlohmann::json object{{"size", volume.size},
                              {"file_size", volume.file_size},
                              {"voxel_size_A", volume.voxel_size_A},
                              {"limits", volume.limits},
                              {"contrast", volume.contrast},
                              {"tile", volume.tile},
                              {"columns", volume.columns},
                              {"rows", volume.rows},
                              {"sheets", std::move(sheets)}};
  return object.dump();
}

}  // namespace tomofield::report
