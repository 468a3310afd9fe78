#include "base/xxhash64.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace tomofield::base {
namespace {

std::uint64_t hash_of(const std::string& text) { return xxhash64(std::as_bytes(std::span(text))); }

// The expected values come from the reference implementation.
TEST(Xxhash64, AgreesWithPublishedValues) {
  EXPECT_EQ(hash_of(""), 0xef46db3751d8e999ULL);
  EXPECT_EQ(hash_of("a"), 0xd24ec4f1a98c6e5bULL);
  EXPECT_EQ(hash_of("abc"), 0x44bc2cf5ad770999ULL);
  EXPECT_EQ(hash_of("Nobody inspects the spammish repetition"), 0xfbcea83c8a378bf1ULL);
}

TEST(Xxhash64, PiecesMakeTheSameAsTheWhole) {
  std::string text;
  for (int i = 0; i < 200; ++i) text += static_cast<char>(i * 7);
  for (const std::size_t piece : {1u, 3u, 31u, 32u, 33u, 64u, 150u, 500u}) {
    Xxhash64 hash;
    for (std::size_t at = 0; at < text.size(); at += piece)
      hash.add(std::as_bytes(std::span(text).subspan(at, std::min(piece, text.size() - at))));
    EXPECT_EQ(hash.value(), hash_of(text)) << piece;
  }
}

TEST(Xxhash64, EveryByteAndTheLengthCount) {
  for (const std::size_t length : {1u, 4u, 7u, 8u, 15u, 31u, 32u, 33u, 77u}) {
    const std::string zeros(length, '\0');
    EXPECT_NE(hash_of(zeros), hash_of(zeros + '\0'));
    for (std::size_t i = 0; i < length; ++i) {
      std::string changed = zeros;
      changed[i] = '\x80';
      EXPECT_NE(hash_of(changed), hash_of(zeros)) << i << " of " << length;
    }
  }
}

}  // namespace
}  // namespace tomofield::base
