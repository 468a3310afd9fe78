#include "io/mrc_values.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "base/check.h"
#include "io/half_float.h"
#include "io/mrc_header.h"

namespace tomofield::io {
namespace {

template <typename T, typename Convert>
void decode_as(std::span<const std::byte> raw, std::span<float> out, Convert convert) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    T value;
    std::memcpy(&value, raw.data() + i * sizeof(T), sizeof(T));
    out[i] = convert(value);
  }
}

template <typename T, typename Convert, typename Restore>
void encode_as(std::span<const float> values, std::span<std::byte> raw, std::span<float> stored,
               Convert convert, Restore restore) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const T value = convert(values[i]);
    std::memcpy(raw.data() + i * sizeof(T), &value, sizeof(T));
    stored[i] = restore(value);
  }
}

template <typename T>
void encode_integers(std::span<const float> values, std::span<std::byte> raw,
                     std::span<float> stored) {
  const auto round_and_clamp = [](float value) {
    if (std::isnan(value)) return T{0};
    constexpr auto kLow = static_cast<float>(std::numeric_limits<T>::min());
    constexpr auto kHigh = static_cast<float>(std::numeric_limits<T>::max());
    return static_cast<T>(std::nearbyint(std::clamp(value, kLow, kHigh)));
  };
  encode_as<T>(values, raw, stored, round_and_clamp, [](T v) { return static_cast<float>(v); });
}

void swap_bytes(std::span<std::byte> raw, std::size_t width) {
  for (std::size_t i = 0; i + width <= raw.size(); i += width) {
    std::reverse(raw.data() + i, raw.data() + i + width);
  }
}

}  // namespace

void decode_values(const MrcHeader& header, std::span<std::byte> raw, std::span<float> out) {
  const std::size_t width = bytes_per_value(header.mode);
  TOMOFIELD_CHECK(raw.size() == out.size() * width, "raw bytes must match the values");
  if (header.is_byte_swapped && width > 1) swap_bytes(raw, width);
  const auto to_float = [](auto value) { return static_cast<float>(value); };
  switch (header.mode) {
    case MrcMode::kInt8:
      return header.bytes_are_unsigned ? decode_as<std::uint8_t>(raw, out, to_float)
                                       : decode_as<std::int8_t>(raw, out, to_float);
    case MrcMode::kInt16:
      return decode_as<std::int16_t>(raw, out, to_float);
    case MrcMode::kUint16:
      return decode_as<std::uint16_t>(raw, out, to_float);
    case MrcMode::kFloat16:
      return decode_as<std::uint16_t>(raw, out, float_from_half);
    case MrcMode::kFloat32:
      return decode_as<float>(raw, out, to_float);
  }
}

void encode_values(MrcMode mode, std::span<const float> values, std::span<std::byte> raw,
                   std::span<float> stored) {
  TOMOFIELD_CHECK(
      raw.size() == values.size() * bytes_per_value(mode) && stored.size() == values.size(),
      "raw bytes and stored values must match the values");
  switch (mode) {
    case MrcMode::kInt8:
      return encode_integers<std::int8_t>(values, raw, stored);
    case MrcMode::kInt16:
      return encode_integers<std::int16_t>(values, raw, stored);
    case MrcMode::kUint16:
      return encode_integers<std::uint16_t>(values, raw, stored);
    case MrcMode::kFloat16:
      return encode_as<std::uint16_t>(values, raw, stored, half_from_float, float_from_half);
    case MrcMode::kFloat32:
      std::memcpy(raw.data(), values.data(), raw.size());
      std::copy(values.begin(), values.end(), stored.begin());
      return;
  }
}

}  // namespace tomofield::io
