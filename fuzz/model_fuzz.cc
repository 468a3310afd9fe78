#include <algorithm>

#include "hdf5_input.h"
#include "output/model_file.h"

namespace {

using namespace tomofield;

// Asks for densities all over the field.
void sample(const field::Field& field) {
  const field::RootGrid& roots = field.tree().roots();
  const double width = static_cast<double>(roots.columns) * static_cast<double>(roots.cell_size);
  const double height = static_cast<double>(roots.rows) * static_cast<double>(roots.cell_size);
  for (const double part : {-0.1, 0.0, 0.3, 0.7, 1.0})
    field.density(static_cast<double>(roots.x0) + part * width,
                  static_cast<double>(roots.y0) + part * height, part * field.thickness());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes = fuzz::with_right_checksums(data, size);
  const fuzz::InputFile file(bytes.data(), bytes.size());
  fuzz::refuse_or([&] {
    output::TrainingState training;
    sample(*output::load_model(file.path(), &training).field);
  });
  fuzz::refuse_or([&] { output::load_outline(file.path()); });
  return 0;
}
