#pragma once

#include <cstddef>
#include <span>

#include "prior/lattice.h"
#include "prior/network.h"

namespace tomofield::prior {

/// Sides of the parts in which a lattice is worked on, multiples of Network::kSideUnit: every part
/// then halves the same pairs of vertices.
struct PartSize {
  int x = 128, z = 128, y = 64;
};

/// Replaces the densities of a lattice by a network's answer to them. `smooth` are the parameters
/// of the field, which become the answer; `light` those of a fit of the same field with less
/// smoothing. The mean density is taken away before and added after. The lattice is worked on in
/// parts, so that memory() is small beside large fields; the number of threads changes no bit.
void replace_by_answer(const Network& network, const Lattice& lattice, std::span<float> smooth,
                       std::span<const float> light, const PartSize& size = {});

/// Returns about the bytes that replace_by_answer() takes for a lattice.
std::size_t answer_memory(const BoxShape& lattice);

}  // namespace tomofield::prior
