#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "fuzz_input.h"
#include "hdf5_edits.h"
#include "io/hdf5/hdf5_objects.h"

namespace tomofield::fuzz {

/// Makes the checksums of all arrays below an object right.
inline void repair_arrays(const io::Hdf5Object& object, testing::Hdf5Edits& edits) {
  const auto checksum = object.attributes.find("xxh64");
  if (object.array && checksum != object.attributes.end()) {
    const std::string before(checksum->second.bytes.c_str());
    constexpr std::size_t kDigits = 16;
    if (before.size() == kDigits)
      edits.put_checksum(before, static_cast<std::size_t>(object.address),
                         object.array->count * object.array->bytes_each);
  }
  for (const auto& [name, child] : object.children) repair_arrays(child, edits);
}

/// Returns an input with right checksums of headers and arrays, so that what is changed in it
/// reaches the code behind them.
inline std::string with_right_checksums(const std::uint8_t* data, std::size_t size) {
  testing::Hdf5Edits edits(std::string(reinterpret_cast<const char*>(data), size));
  edits.repair();
  refuse_or([&] {
    const InputFile file(edits.bytes().data(), edits.size());
    repair_arrays(
        io::read_hdf5_objects(io::PositionedFile(file.path(), io::PositionedFile::Access::kRead)),
        edits);
  });
  return edits.bytes();
}

}  // namespace tomofield::fuzz
