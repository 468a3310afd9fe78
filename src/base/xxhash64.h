#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tomofield::base {

/// XXH64 with seed 0 (Collet, xxHash specification 0.1.1): a checksum as fast as
/// memory, with implementations in every language. Bytes are read as this
/// machine orders them, so the machine must be little-endian.
std::uint64_t xxhash64(std::span<const std::byte> bytes);

/// The same of bytes that come piece by piece.
class Xxhash64 {
 public:
  Xxhash64();
  void add(std::span<const std::byte> bytes);
  std::uint64_t value() const;  ///< of all so far

 private:
  static constexpr std::size_t kStripe = 32;
  void add_stripe(const std::byte* stripe);

  std::array<std::uint64_t, 4> lanes_;
  std::array<std::byte, kStripe> rest_{};  // what makes no whole stripe yet
  std::size_t rest_size_ = 0;
  std::uint64_t length_ = 0;
};

}  // namespace tomofield::base
