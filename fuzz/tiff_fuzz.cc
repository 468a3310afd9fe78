#include <vector>

#include "fuzz_input.h"
#include "io/images/tiff_stack.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tomofield::fuzz::InputFile file(data, size);
  tomofield::fuzz::refuse_or([&] {
    const auto stack = tomofield::io::open_tiff_stack(file.path());
    const auto& header = stack->header();
    // Small compressed files may have pages that are larger than a target's memory.
    constexpr std::int64_t kMostPixels = std::int64_t{1} << 24;
    if (header.nx * header.ny > kMostPixels) return;
    std::vector<float> section(static_cast<std::size_t>(header.nx * header.ny));
    stack->read_section(0, section);
    stack->read_section(header.nz - 1, section);
  });
  return 0;
}
