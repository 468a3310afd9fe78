#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz_input.h"
#include "io/images/mrc.h"
#include "projects/project.h"

namespace {

namespace fs = std::filesystem;
using namespace tomofield;

/// A folder in memory with a raw and an aligned stack and transforms.
fs::path make_folder() {
  const fs::path folder = "/dev/shm/tomofield-fuzz-" + std::to_string(::getpid());
  fs::create_directories(folder);
  io::MrcSpec spec;
  spec.nx = 24;
  spec.ny = 20;
  spec.nz = 5;
  for (const char* name : {"TS.st", "TS_ali.mrc"}) io::MrcWriter(folder / name, spec).close();
  std::ofstream transforms(folder / "TS.xf");
  for (int i = 0; i < 5; ++i) transforms << "1 0 0 1 0.5 0\n";
  std::ofstream(folder / "TS.xtilt") << "0\n0\n0\n0\n0\n";
  return folder;
}

void write(const fs::path& path, std::string_view text) {
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace

// An input is tilt.com and, after a byte 1, newst.com.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fs::path folder = make_folder();
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::size_t end = std::min(text.find('\1'), text.size());
  write(folder / "tilt.com", text.substr(0, end));
  fs::remove(folder / "newst.com");
  if (end < text.size()) write(folder / "newst.com", text.substr(end + 1));
  fuzz::refuse_or([&] { projects::read_project({.path = folder / "tilt.com", .ignored = {}}); });
  return 0;
}
