#include "base/random.h"

#include <bit>

namespace tomofield::base {
namespace {

// A polynomial over GF(2) of degree below 256: bit i of all bits is the coefficient of x^i.
using Polynomial = std::array<std::uint64_t, 4>;

// Steps of the generator are multiplications of its state by x modulo x^256 + this polynomial (the
// characteristic polynomial of xoshiro256).
constexpr Polynomial kModulus = {0x9d116f2bb0f0f001u, 0x0280002bcefd1a5eu, 0x04b4edcf26259f85u,
                                 0x0003c03c3f3ecb19u};

void add(const Polynomial& from, Polynomial& to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] ^= from[i];
}

void multiply_by_x(Polynomial& p) {
  const bool overflows = (p[3] >> 63) != 0;
  for (std::size_t i = 3; i > 0; --i) p[i] = (p[i] << 1) | (p[i - 1] >> 63);
  p[0] <<= 1;
  if (overflows) add(kModulus, p);
}

bool has_term(const Polynomial& p, int i) { return (p[i / 64] >> (i % 64) & 1) != 0; }

Polynomial square(const Polynomial& p) {
  Polynomial product{};
  for (int i = 255; i >= 0; --i) {
    multiply_by_x(product);
    if (has_term(p, i)) add(p, product);
  }
  return product;
}

// Returns x^n, reduced.
Polynomial power_of_x(std::uint64_t n) {
  Polynomial power = {1};
  for (int bit = 63 - std::countl_zero(n); bit >= 0; --bit) {
    power = square(power);
    if ((n >> bit & 1) != 0) multiply_by_x(power);
  }
  return power;
}

}  // namespace

void Random::skip(std::uint64_t count) {
  const Polynomial power = power_of_x(count);
  Polynomial state{};
  for (int i = 0; i < 256; ++i) {
    if (has_term(power, i)) add(state_, state);
    bits();
  }
  state_ = state;
}

}  // namespace tomofield::base
