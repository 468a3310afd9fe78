#include "prior/weights.h"

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "base/check.h"
#include "prior/network.h"

namespace tomofield::prior {
namespace {

#include "prior/weights_table.inc"

// Returns the bytes that a text in base 64 stands for (RFC 4648).
std::vector<std::int8_t> bytes_of(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::int8_t> bytes;
  std::uint32_t bits = 0;
  int num_bits = 0;
  for (const char digit : text) {
    if (digit == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(kDigits.find(digit));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes.push_back(static_cast<std::int8_t>(bits >> num_bits & 0xff));
  }
  return bytes;
}

std::vector<float> decoded_weights() {
  std::string text;
  for (const std::string_view line : kWeights) text += line;
  const std::vector<std::int8_t> bytes = bytes_of(text);
  TOMOFIELD_CHECK(bytes.size() == Network::num_weights(), "a number for each weight");
  std::vector<float> weights;
  const float* scale = kScales;
  for (const std::size_t size : Network::filter_sizes()) {
    for (std::size_t i = 0; i < size; ++i)
      weights.push_back(*scale * static_cast<float>(bytes[weights.size()]));
    ++scale;
  }
  TOMOFIELD_CHECK(scale == std::end(kScales), "a scale for each filter");
  return weights;
}

}  // namespace

std::span<const float> trained_weights() {
  static const std::vector<float> weights = decoded_weights();
  return weights;
}

}  // namespace tomofield::prior
