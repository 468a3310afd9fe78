#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tomofield::base {

/// Returns XXH64 of `bytes` with seed 0 (Collet, xxHash specification 0.1.1): a checksum as fast as
/// memory, with implementations in every language. Words are read in this machine's byte order, so
/// the machine must be little-endian.
std::uint64_t xxhash64(std::span<const std::byte> bytes);

/// Computes XXH64 of bytes that arrive in pieces.
class Xxhash64 {
 public:
  Xxhash64();
  void add(std::span<const std::byte> bytes);
  std::uint64_t value() const;  ///< of all bytes added so far

 private:
  static constexpr std::size_t kStripe = 32;
  void add_stripe(const std::byte* stripe);

  std::array<std::uint64_t, 4> lanes_;
  std::array<std::byte, kStripe> rest_{};  // bytes that do not fill a stripe yet
  std::size_t rest_size_ = 0;
  std::uint64_t length_ = 0;
};

}  // namespace tomofield::base
