#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace tomofield::io {

/// A group of an HDF5 file. It holds named numbers and texts (attributes), one-dimensional arrays
/// (datasets) and groups. Checksums cover every byte that has a meaning, so that reading detects a
/// file that lost its end, a page or a bit. HDF5's own checksums protect the metadata. The
/// attribute "xxh64" of an array holds XXH64 of its bytes in hexadecimal. (HDF5's Fletcher-32
/// filter accepts a page of zeros, checksum included.) Arrays are written contiguously, without
/// chunks. The same contents make the same bytes.
///
/// Reading throws Error, naming the file and the item, if something is missing, of another kind, or
/// damaged. T is float, double or std::int64_t. Only one thread at a time may use HDF5 files.
/// Groups must not outlive their file.
class Hdf5Group {
 public:
  Hdf5Group(std::string file, std::string name, std::int64_t id);
  ~Hdf5Group();
  Hdf5Group(Hdf5Group&& other) noexcept;
  Hdf5Group& operator=(Hdf5Group&&) = delete;

  Hdf5Group create_group(const std::string& name);
  Hdf5Group group(const std::string& name) const;
  bool has(const std::string& name) const;  ///< true for a group or an array
  bool has_attribute(const std::string& name) const;
  std::vector<std::string> names() const;  ///< names of groups and arrays, sorted

  void write_number(const std::string& name, double value);
  void write_integer(const std::string& name, std::int64_t value);
  void write_text(const std::string& name, const std::string& value);
  double number(const std::string& name) const;
  std::int64_t integer(const std::string& name) const;
  std::string text(const std::string& name) const;

  template <typename T>
  void write_array(const std::string& name, std::span<const T> values);
  /// Writes an array of `size` floats that comes in pieces, from the first element on. `source` is
  /// called once and hands each piece to the sink that it receives.
  using FloatSink = std::function<void(std::span<const float>)>;
  void write_floats(const std::string& name, std::size_t size,
                    const std::function<void(const FloatSink&)>& source);
  /// Hands an array of floats to `sink` in pieces, from the first element on. Throws Error for a
  /// wrong checksum only after the last piece.
  void read_floats(const std::string& name, const FloatSink& sink) const;
  std::size_t array_size(const std::string& name) const;
  /// Fills `values`, which must have as many elements as the array.
  template <typename T>
  void read_array(const std::string& name, std::span<T> values) const;
  template <typename T>
  std::vector<T> read_array(const std::string& name) const {
    std::vector<T> values(array_size(name));
    read_array<T>(name, values);
    return values;
  }

 private:
  std::string path_of(const std::string& name) const;
  template <typename T>
  void write_scalar(const std::string& name, T value);
  template <typename T>
  T read_scalar(const std::string& name) const;

  std::string file_, name_;
  std::int64_t id_;
};

/// An open HDF5 file.
class Hdf5File {
 public:
  /// Creates an empty file and replaces any that exists.
  static Hdf5File create(const std::filesystem::path& path);
  /// Opens a file for reading. Throws Error if it does not exist, is no HDF5 file, or is cut off.
  static Hdf5File open(const std::filesystem::path& path);
  ~Hdf5File();
  Hdf5File(Hdf5File&& other) noexcept;
  Hdf5File& operator=(Hdf5File&&) = delete;

  Hdf5Group root() const;
  /// Writes everything to the disk. Throws Error if the disk does not take it.
  void close();

 private:
  Hdf5File(std::string path, std::int64_t id) : path_(std::move(path)), id_(id) {}
  std::string path_;
  std::int64_t id_;
};

/// Returns true if a file begins with the HDF5 signature, and false if it cannot be read.
bool has_hdf5_signature(const std::filesystem::path& path);

}  // namespace tomofield::io
