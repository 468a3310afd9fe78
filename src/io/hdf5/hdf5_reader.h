#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/plausible.h"
#include "io/hdf5/hdf5_objects.h"
#include "io/saving/positioned_file.h"

namespace tomofield::io {

/// A group of an HDF5 file that Hdf5File wrote, open for reading. It holds named numbers and texts
/// (attributes), one-dimensional arrays and groups. The file may be hostile: everything about it
/// was checked when it was opened (read_hdf5_objects), and the checksums of arrays are checked as
/// they are read.
///
/// Reading throws Error, naming the file and the item, if something is missing, of another kind, or
/// damaged. T is float, double, std::int64_t or std::uint8_t.
class StoredGroup {
 public:
  StoredGroup group(const std::string& name) const;
  bool has(const std::string& name) const;  ///< true for a group or an array
  bool has_attribute(const std::string& name) const;
  std::vector<std::string> names() const;  ///< names of groups and arrays, sorted

  base::Finite number(const std::string& name, base::Interval within) const;
  std::int64_t integer(const std::string& name) const;
  std::string text(const std::string& name) const;

  std::size_t array_size(const std::string& name) const;
  /// Throws Error if an array is larger than the memory that is available: a file may be sparse.
  void require_room(const std::string& name) const;
  /// Hands an array of floats to `sink` in pieces, from the first element on. Throws Error for a
  /// wrong checksum only after the last piece.
  using FloatSink = std::function<void(std::span<const float>)>;
  void read_floats(const std::string& name, const FloatSink& sink) const;
  /// Fills `values`, which must have as many elements as the array.
  template <typename T>
  void read_array(const std::string& name, std::span<T> values) const;
  template <typename T>
  std::vector<T> read_array(const std::string& name) const {
    require_room(name);
    std::vector<T> values(array_size(name));
    read_array<T>(name, values);
    return values;
  }

 private:
  friend class Hdf5Reader;
  struct File {
    PositionedFile file;
    Hdf5Object root;
  };

  StoredGroup(std::shared_ptr<const File> file, const Hdf5Object& object, std::string path)
      : file_(std::move(file)), object_(&object), path_(std::move(path)) {}
  [[noreturn]] void fail(const std::string& name, const std::string& reason) const;
  const Hdf5Attribute& value(const std::string& name) const;
  const Hdf5Object& child(const std::string& name) const;
  const Hdf5Object& array(const std::string& name) const;
  const Hdf5Object& array_of(const std::string& name, Hdf5Values::Type type) const;
  void require_checksum(const std::string& name, const Hdf5Object& array,
                        std::uint64_t found) const;

  std::shared_ptr<const File> file_;
  const Hdf5Object* object_;
  std::string path_;  // within the file
};

/// An HDF5 file that is open for reading.
class Hdf5Reader {
 public:
  /// Opens a file. Throws Error if it does not exist, is no regular file, is no HDF5 file, is
  /// damaged, or has anything that Hdf5File does not write.
  explicit Hdf5Reader(const std::filesystem::path& path);
  StoredGroup root() const;

 private:
  std::shared_ptr<const StoredGroup::File> file_;
};

/// Returns true if a file begins with the HDF5 signature, and false if it cannot be read.
bool has_hdf5_signature(const std::filesystem::path& path);

}  // namespace tomofield::io
