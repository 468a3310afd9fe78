#include "output/sample_model.h"

#include <limits>

#include "base/system/memory.h"
#include "compact/sample_coded.h"

namespace tomofield::output {

std::size_t usual_decoded_bytes() {
  const std::size_t free = base::available_memory();
  return free == 0 ? std::numeric_limits<std::size_t>::max() : free / 4;
}

Model load_to_sample(const std::filesystem::path& path, std::size_t most_bytes) {
  return load_decoded_up_to(path, most_bytes);
}

void sample_box(const Model& model, const field::OrientedBox& box, const field::BoxSink& sink) {
  if (model.field)
    field::sample_box(*model.field, box, sink);
  else
    compact::sample_box(*model.coded, box, sink);
}

std::vector<float> sample_box(const Model& model, const field::OrientedBox& box) {
  return model.field ? field::sample_box(*model.field, box)
                     : compact::sample_box(*model.coded, box);
}

std::vector<float> sample_points(const Model& model, std::span<const field::Point> points) {
  return model.field ? field::sample_points(*model.field, points)
                     : compact::sample_points(*model.coded, points);
}

}  // namespace tomofield::output
