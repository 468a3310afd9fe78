#include "io/hdf5/lookup3.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace tomofield::io {
namespace {

using Words = std::array<std::uint32_t, 3>;

void mix(Words& w) {
  auto& [a, b, c] = w;
  a = (a - c) ^ std::rotl(c, 4), c += b;
  b = (b - a) ^ std::rotl(a, 6), a += c;
  c = (c - b) ^ std::rotl(b, 8), b += a;
  a = (a - c) ^ std::rotl(c, 16), c += b;
  b = (b - a) ^ std::rotl(a, 19), a += c;
  c = (c - b) ^ std::rotl(b, 4), b += a;
}

void mix_last(Words& w) {
  auto& [a, b, c] = w;
  c = (c ^ b) - std::rotl(b, 14);
  a = (a ^ c) - std::rotl(c, 11);
  b = (b ^ a) - std::rotl(a, 25);
  c = (c ^ b) - std::rotl(b, 16);
  a = (a ^ c) - std::rotl(c, 4);
  b = (b ^ a) - std::rotl(a, 14);
  c = (c ^ b) - std::rotl(b, 24);
}

// Adds up to twelve bytes, the lowest of a word first.
void add(std::string_view bytes, Words& w) {
  Words block{};
  std::memcpy(block.data(), bytes.data(), std::min(bytes.size(), sizeof block));
  for (std::size_t i = 0; i < w.size(); ++i) w[i] += block[i];
}

}  // namespace

std::uint32_t lookup3(std::string_view bytes) {
  Words words;
  words.fill(0xdeadbeef + static_cast<std::uint32_t>(bytes.size()));
  for (; bytes.size() > sizeof words; bytes.remove_prefix(sizeof words)) {
    add(bytes, words);
    mix(words);
  }
  if (bytes.empty()) return words[2];
  add(bytes, words);
  mix_last(words);
  return words[2];
}

}  // namespace tomofield::io
