#pragma once

#include <cstddef>
#include <span>

#include "base/range.h"
#include "distributed/communicator.h"
#include "prior/lattice.h"
#include "prior/network.h"

namespace tomofield::prior {

/// Sides of the parts in which a lattice is worked on, multiples of Network::kSideUnit: every part
/// then halves the same pairs of vertices.
struct PartSize {
  int x = 128, z = 128, y = 64;
};

/// Number of rows before and after some rows of a lattice whose densities their answer depends on.
inline constexpr int kRowsBeyond = Network::kReach + Network::kSideUnit;

/// Returns the mean density of a lattice whose rows are divided among processes: `own` are those of
/// this one, and `parameters` have their densities. Every process calls it. Sums of single rows are
/// added in their order, so that the mean has the same bits for any division.
float mean_density(const Lattice& lattice, base::Range own, std::span<const float> parameters,
                   const distributed::Communicator& processes);

/// The part of a lattice that a process answers for.
struct AnsweredRows {
  base::Range rows;   ///< the first one is a multiple of Network::kSideUnit
  float mean = 0.0f;  ///< density of the whole lattice
};

/// Replaces the densities of some rows of a lattice by a network's answer to them. The row after
/// them, which lies on the face of their leaves, is replaced as well. `smooth` are the parameters
/// of the field, which become the answer; `light` those of a fit of the same field with less
/// smoothing. Both must have the densities of kRowsBeyond rows on either side. The mean density is
/// taken away before and added after. The lattice is worked on in parts, so that answer_memory() is
/// small beside large fields. The parts, and the number of threads, change no bit.
void replace_by_answer(const Network& network, const Lattice& lattice, const AnsweredRows& own,
                       std::span<float> smooth, std::span<const float> light,
                       const PartSize& size = {});

/// Returns about the bytes that replace_by_answer() takes for some rows of a lattice.
std::size_t answer_memory(const BoxShape& lattice, base::Range rows);

}  // namespace tomofield::prior
