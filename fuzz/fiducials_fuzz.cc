#include "fuzz_input.h"
#include "io/tables/fiducial_points.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tomofield::fuzz::InputFile file(data, size);
  tomofield::fuzz::refuse_or([&] { tomofield::io::read_fiducial_points(file.path()); });
  return 0;
}
