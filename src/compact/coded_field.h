#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "tomofield/error.h"

namespace tomofield::compact {

/// The codes of all leaves (leaf_code.h), one after the other. A leaf has its lower faces alone:
/// its upper faces are the lower ones of its neighbours, so nothing is stored twice.
struct LeafCodes {
  /// [band of the tree] of the densities' whole numbers.
  std::vector<double> step;
  /// [band of the tree] Neighbouring vertices of two leaves, d apart in density, move towards each
  /// other by this times d; the mean of both counts where two bands meet. It makes up for errors of
  /// the leaves, which know nothing of each other.
  std::vector<double> face_weight;
  std::vector<field::LeafShape> shapes;  ///< a leaf's vertices but those of its upper faces
  std::vector<std::int64_t> offset;      ///< [leaf + 1] index in `bytes` of a leaf's first byte
  std::vector<std::uint8_t> bytes;

  /// Returns how many numbers the codes stand for.
  std::size_t num_parameters() const;
  std::span<const std::uint8_t> code(int leaf) const;
};

/// Is thrown for a code that is damaged, without the name of its file.
struct DamagedCode : Error {
  using Error::Error;
};

/// Stands for a leaf where the field that was compressed has none.
inline constexpr field::LeafShape kNoLeaf{.nx = 1, .ny = 1, .nz = 2};

/// Returns the shape of a leaf with its upper faces.
field::LeafShape with_upper_faces(const field::LeafShape& shape);

/// Says whether the ranks of a leaf are those of modes, whose vectors are orthonormal
/// (truncation.h). Then its factors are at most about three times as many as its vertices.
bool has_possible_ranks(const field::LeafShape& shape);

/// Stands for more bytes than any memory has.
inline constexpr std::size_t kNoMemoryHolds = std::numeric_limits<std::size_t>::max();

/// Returns the bytes that leaves take at most in memory while they are decoded by some threads: the
/// vertices of all, and what each thread holds for the leaf that it decodes. Returns kNoMemoryHolds
/// if there are more than 2^40 numbers.
std::size_t decoded_bytes(const std::vector<field::LeafShape>& shapes, int num_threads);

/// A field as codes, which take little memory (decode_field).
struct CodedField {
  field::Quadtree tree;
  double thickness = 0.0;
  LeafCodes codes;
  std::string file{};  ///< that it was read from; empty: none
};

/// Says whether the bands of a field follow those of `lower`.
bool is_joinable(const CodedField& lower, const CodedField& upper);

/// Appends bands that follow those of `lower`.
void append(CodedField& lower, const CodedField& upper);

/// Returns some bands of a field.
CodedField some_bands(const CodedField& field, base::Range bands);

}  // namespace tomofield::compact
