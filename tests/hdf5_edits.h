#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/xxhash64.h"
#include "io/hdf5/lookup3.h"

namespace tomofield::testing {

/// A part of an HDF5 file with a checksum behind it.
struct CheckedPart {
  std::size_t begin = 0, size = 0;  ///< without the checksum
};

/// Edits the bytes of an HDF5 file of tomofield and makes its checksums right again, so that only
/// the meaning is wrong. The bytes may be any.
class Hdf5Edits {
 public:
  explicit Hdf5Edits(std::string bytes) : bytes_(std::move(bytes)) { find_parts(); }

  const std::string& bytes() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }
  /// Returns the superblock and the headers of objects, as they were at first.
  const std::vector<CheckedPart>& parts() const { return parts_; }

  /// Makes the checksums of all parts right.
  Hdf5Edits& repair() {
    for (const CheckedPart& part : parts_) {
      const std::uint32_t sum = io::lookup3(std::string_view(bytes_).substr(part.begin, part.size));
      std::memcpy(bytes_.data() + part.begin + part.size, &sum, sizeof sum);
    }
    return *this;
  }

  Hdf5Edits& put(std::size_t at, std::string_view with) {
    bytes_.replace(at, with.size(), with);
    return repair();
  }
  template <typename T>
  Hdf5Edits& put_number(std::size_t at, T value) {
    return put(at, {reinterpret_cast<const char*>(&value), sizeof value});
  }

  /// Replaces all data of an array, which lie from `at` on, and their checksum.
  Hdf5Edits& put_data(std::size_t at, std::span<const std::byte> values) {
    const std::string before = checksum_of(at, values.size());
    std::memcpy(bytes_.data() + at, values.data(), values.size());
    return put_checksum(before, at, values.size());
  }
  /// Replaces the checksum `before` by that of the data of an array.
  Hdf5Edits& put_checksum(const std::string& before, std::size_t at, std::size_t size) {
    const std::size_t stored = bytes_.find(before);
    return stored == std::string::npos ? *this : put(stored, checksum_of(at, size));
  }

 private:
  std::string checksum_of(std::size_t at, std::size_t size) const {
    const std::span data(bytes_.data() + at, size);
    char text[17];
    std::snprintf(text, sizeof text, "%016llx",
                  static_cast<unsigned long long>(base::xxhash64(std::as_bytes(data))));
    return text;
  }

  std::uint64_t number(std::size_t at, std::size_t width) const {
    std::uint64_t value = 0;
    if (at <= bytes_.size() && width <= bytes_.size() - at)
      std::memcpy(&value, bytes_.data() + at, width);
    return value;
  }

  void add_part(std::uint64_t begin, std::uint64_t size) {
    constexpr std::uint64_t kChecksumBytes = 4;
    const std::uint64_t end = bytes_.size();
    if (begin <= end && size <= end - begin && end - begin - size >= kChecksumBytes)
      parts_.push_back({begin, size});
  }

  void find_parts() {
    constexpr std::uint64_t kSuperblockBytes = 44;
    add_part(0, kSuperblockBytes);
    for (std::size_t at = bytes_.find("OHDR"); at != std::string::npos;
         at = bytes_.find("OHDR", at + 4)) {
      const std::uint64_t flags = number(at + 5, 1);
      const std::size_t first = at + 6 + (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0);
      const std::size_t width = std::size_t{1} << (flags & 3);
      const std::size_t messages = first + width;
      const std::uint64_t size = std::min<std::uint64_t>(number(first, width), bytes_.size());
      add_part(at, messages - at + size);
      add_continuations(messages, size, flags & 4 ? 6 : 4);
    }
  }

  void add_continuations(std::size_t messages, std::size_t size, std::size_t head) {
    const std::size_t end = std::min(messages + size, bytes_.size());
    for (std::size_t at = messages; at + head <= end; at += head + number(at + 1, 2)) {
      const std::uint64_t length = number(at + head + 8, 8);
      if (number(at, 1) == 0x10 && length > 4) add_part(number(at + head, 8), length - 4);
    }
  }

  std::string bytes_;
  std::vector<CheckedPart> parts_;
};

}  // namespace tomofield::testing
