#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include "base/log.h"
#include "base/threads/parallel.h"
#include "fuzz_input.h"
#include "tilt_series/tilt_series.h"

namespace {

using namespace tomofield;

// An input is a list of files: a byte for the kind, four for the length, and the bytes. The kinds
// are these, in this order.
constexpr std::size_t kKinds = 8;
struct Files {
  std::array<std::unique_ptr<fuzz::InputFile>, kKinds> of_kind;

  explicit Files(std::string_view input) {
    constexpr std::size_t kHead = 5;
    while (input.size() >= kHead) {
      const auto kind = static_cast<unsigned char>(input[0]) % kKinds;
      std::uint32_t length = 0;
      std::memcpy(&length, input.data() + 1, sizeof length);
      const std::string_view contents = input.substr(kHead, length);
      of_kind[kind] = std::make_unique<fuzz::InputFile>(contents.data(), contents.size());
      input.remove_prefix(kHead + contents.size());
    }
  }
  std::optional<std::filesystem::path> path(std::size_t kind) const {
    return of_kind[kind] ? std::optional(of_kind[kind]->path()) : std::nullopt;
  }
};

// A series of a few thousand pixels has all that a large one has.
bool is_small(const std::filesystem::path& stack) {
  bool is_small = false;
  fuzz::refuse_or([&] {
    const io::MrcReader reader(stack);
    is_small = reader.header().nx * reader.header().ny <= 4096 && reader.header().nz <= 64;
  });
  return is_small;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  base::set_log_sink([](base::LogLevel, std::string_view) {});
  base::set_thread_count(1);
  const Files files({reinterpret_cast<const char*>(data), size});
  if (!files.path(0) || !is_small(*files.path(0))) return 0;
  tilt_series::TiltSeriesOptions options;
  options.stack = *files.path(0);
  options.tlt = files.path(1);
  options.xf = files.path(2);
  options.xtilt = files.path(3);
  options.aln = files.path(4);
  options.mdoc = files.path(5);
  options.fiducials = files.path(6);
  options.mask = files.path(7);
  for (const Contrast contrast : {Contrast::kBright, Contrast::kDark}) {
    options.contrast = contrast;
    fuzz::refuse_or([&] { const tilt_series::TiltSeries series(options); });
  }
  return 0;
}
