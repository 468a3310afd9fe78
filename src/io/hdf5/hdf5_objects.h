#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

// The parts of the HDF5 format (version 3 of its specification) that tomofield writes, as they lie
// in a file. No library reads files here: HDF5's own crashes, waits or takes all memory for files
// that were made to do so, even where all checksums are right.

/// The type and the number of some values.
struct Hdf5Values {
  enum class Type { kFloat32, kFloat64, kInteger64, kByte, kText };
  Type type = Type::kText;
  std::size_t bytes_each = 0;  ///< of a text: its length with padding
  int rank = 0;                ///< number of dimensions; 0 for a single value
  std::size_t count = 0;
};

/// A small value that is stored with its owner.
struct Hdf5Attribute {
  Hdf5Values values;
  std::string bytes;  ///< values.count × values.bytes_each
};

/// A group or an array of a file.
struct Hdf5Object {
  std::map<std::string, Hdf5Attribute> attributes;
  std::map<std::string, Hdf5Object> children;  ///< of a group
  std::optional<Hdf5Values> array;             ///< none for a group
  std::int64_t address = 0;                    ///< of the array's first byte in the file
};

/// Says what a file has that tomofield does not write: it is of another program, or damaged.
class ForeignHdf5 : public Error {
 public:
  using Error::Error;
};

/// Reads all groups, attributes and descriptions of arrays of a file, and checks all checksums of
/// the format. Throws Error if anything is damaged, lies beyond the end of the file or overlaps
/// something else, and ForeignHdf5 if it is a feature of HDF5 that tomofield does not write: other
/// versions of the format, links, external, virtual, chunked or filtered arrays, other types. What
/// it returns takes memory in proportion to the file, and so do all of its arrays together.
Hdf5Object read_hdf5_objects(const PositionedFile& file);

}  // namespace tomofield::io
