#include "compact/leaf_code.h"

#include <fmt/format.h>
#include <lzma.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "base/check.h"
#include "base/progress.h"
#include "compact/coded_field.h"
#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

using field::LeafShape;

constexpr int kMostBytes = 5;                       // of a number of 32 bits, seven a byte
constexpr std::size_t kMostNumbersAByte = 1 << 14;  // of a code: LZMA packs zeros 8,000 times
constexpr std::ptrdiff_t kNumbersAtOnce = 1 << 20;  // between which a stop is looked for

// The lengths of vectors and matrices and the rank of one mode.
struct ModeShape {
  std::size_t vector = 0, matrix = 0, rank = 0;
  std::size_t size() const { return (vector + matrix) * rank; }
};

std::array<ModeShape, 3> modes_of(const LeafShape& s) {
  const auto nx = static_cast<std::size_t>(s.nx), ny = static_cast<std::size_t>(s.ny),
             nz = static_cast<std::size_t>(s.nz);
  return {{{nx, nz * ny, static_cast<std::size_t>(s.rank_x)},
           {ny, nx * nz, static_cast<std::size_t>(s.rank_y)},
           {nz, nx * ny, static_cast<std::size_t>(s.rank_z)}}};
}

std::size_t count_numbers(const LeafShape& shape) {
  std::size_t count = 0;
  for (const ModeShape& mode : modes_of(shape)) count += mode.size();
  return count;
}

// Returns what a mode's vector of whole numbers is to be multiplied by: it has length 1.
double scale_of(std::span<const std::int32_t> vector) {
  double square = 0;
  for (const std::int32_t number : vector) square += static_cast<double>(number) * number;
  return square > 0 ? 1 / std::sqrt(square) : 0;
}

// Describes the codes: numbers have no patterns, so no byte before or position tells of the next.
struct Filters {
  Filters() {
    if (lzma_lzma_preset(&options, LZMA_PRESET_DEFAULT)) throw std::bad_alloc();
    options.dict_size = kDictionary;
    options.lc = options.lp = options.pb = 0;
  }
  static constexpr std::uint32_t kDictionary = 1 << 16;
  lzma_options_lzma options{};
  std::array<lzma_filter, 2> chain{{{.id = LZMA_FILTER_LZMA2, .options = &options},
                                    {.id = LZMA_VLI_UNKNOWN, .options = nullptr}}};
};

constexpr std::size_t kChecksumBytes = 4;

std::array<std::uint8_t, kChecksumBytes> checksum(std::span<const std::uint8_t> bytes) {
  const std::uint32_t sum = lzma_crc32(bytes.data(), bytes.size(), 0);
  std::array<std::uint8_t, kChecksumBytes> little_endian{};
  for (std::size_t i = 0; i < little_endian.size(); ++i)
    little_endian[i] = static_cast<std::uint8_t>(sum >> (8 * i));
  return little_endian;
}

}  // namespace

void dequantise(const QuantisedLeaf& leaf, double step, std::span<float> parameters) {
  TOMOFIELD_CHECK(leaf.numbers.size() == count_numbers(leaf.shape), "one number a parameter");
  std::span<const std::int32_t> numbers(leaf.numbers);
  float* to = parameters.data();
  for (const ModeShape& mode : modes_of(leaf.shape)) {
    for (std::size_t r = 0; r < mode.rank; ++r) {
      const auto vector = numbers.subspan(r * mode.vector, mode.vector);
      const auto matrix = numbers.subspan(mode.rank * mode.vector + r * mode.matrix, mode.matrix);
      const double scale = scale_of(vector);
      for (std::size_t i = 0; i < vector.size(); ++i)
        to[i * mode.rank + r] = static_cast<float>(vector[i] * scale);
      for (std::size_t i = 0; i < matrix.size(); ++i)
        to[(mode.vector + i) * mode.rank + r] = static_cast<float>(matrix[i] * step);
    }
    to += mode.size();
    numbers = numbers.subspan(mode.size());
  }
}

std::vector<std::uint8_t> encode(const QuantisedLeaf& leaf) {
  if (leaf.numbers.empty()) return {};
  std::vector<std::uint8_t> plain;
  plain.reserve(leaf.numbers.size());
  for (const std::int32_t number : leaf.numbers) {
    auto rest =
        (static_cast<std::uint32_t>(number) << 1) ^ static_cast<std::uint32_t>(number >> 31);
    for (; rest >= 0x80; rest >>= 7)
      plain.push_back(static_cast<std::uint8_t>(0x80 | (rest & 0x7F)));
    plain.push_back(static_cast<std::uint8_t>(rest));
  }
  const Filters filters;
  std::vector<std::uint8_t> code(lzma_stream_buffer_bound(plain.size()));
  std::size_t size = 0;
  const lzma_ret result = lzma_raw_buffer_encode(filters.chain.data(), nullptr, plain.data(),
                                                 plain.size(), code.data(), &size, code.size());
  if (result == LZMA_MEM_ERROR) throw std::bad_alloc();
  TOMOFIELD_CHECK(result == LZMA_OK, "LZMA packs any bytes");
  code.resize(size);
  std::ranges::copy(checksum(plain), std::back_inserter(code));
  return code;
}

QuantisedLeaf decode(std::span<const std::uint8_t> code, const LeafShape& shape) {
  const std::size_t count = count_numbers(shape);
  if (count / kMostNumbersAByte > code.size())
    throw DamagedCode("the code of a leaf is too short for it");
  QuantisedLeaf leaf{.shape = shape, .numbers = std::vector<std::int32_t>(count)};
  if (count == 0 && code.empty()) return leaf;
  std::vector<std::uint8_t> plain(count * kMostBytes);
  const std::size_t end = code.size() < kChecksumBytes ? 0 : code.size() - kChecksumBytes;
  const Filters filters;
  std::size_t read = 0, size = 0;
  const lzma_ret result = lzma_raw_buffer_decode(filters.chain.data(), nullptr, code.data(), &read,
                                                 end, plain.data(), &size, plain.size());
  if (result == LZMA_MEM_ERROR) throw std::bad_alloc();
  plain.resize(size);
  if (result != LZMA_OK || read != end || !std::ranges::equal(checksum(plain), code.subspan(end)))
    throw DamagedCode("the code of a leaf is damaged");
  auto at = plain.begin();
  for (std::int32_t& number : leaf.numbers) {
    if ((&number - leaf.numbers.data()) % kNumbersAtOnce == 0) base::allow_interruption();
    std::uint32_t bits = 0;
    for (int shift = 0;; shift += 7) {
      if (at == plain.end() || shift >= 7 * kMostBytes)
        throw DamagedCode("the code of a leaf ends early or has no numbers");
      const auto byte = static_cast<std::uint32_t>(*at++);
      if ((byte & 0x7F) > std::numeric_limits<std::uint32_t>::max() >> shift)
        throw DamagedCode("the code of a leaf has a number of more than 32 bits");
      bits |= (byte & 0x7F) << shift;
      if (byte < 0x80) break;
    }
    number = static_cast<std::int32_t>((bits >> 1) ^ (0U - (bits & 1U)));
  }
  if (at != plain.end())
    throw DamagedCode("the code of a leaf has more numbers than its shape says");
  return leaf;
}

}  // namespace tomofield::compact
