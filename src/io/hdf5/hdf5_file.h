#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace tomofield::io {

/// A group of an HDF5 file that is being written. It holds named numbers and texts (attributes),
/// one-dimensional arrays (datasets) and groups; StoredGroup (hdf5_reader.h) reads it. A group has
/// at most eight attributes and eight members: HDF5 keeps more of them in another form, which
/// StoredGroup does not read.
///
/// Checksums cover every byte that has a meaning, so that reading detects a file that lost its end,
/// a page or a bit. HDF5's own checksums protect the metadata. The attribute "xxh64" of an array
/// holds XXH64 of its bytes in hexadecimal. (HDF5's Fletcher-32 filter accepts a page of zeros,
/// checksum included.) Arrays are written contiguously, without chunks. The same contents make the
/// same bytes.
///
/// T is float, double, std::int64_t or std::uint8_t. Only one thread at a time may write HDF5
/// files. Groups must not outlive their file.
class Hdf5Group {
 public:
  Hdf5Group(std::string file, std::string name, std::int64_t id);
  ~Hdf5Group();
  Hdf5Group(Hdf5Group&& other) noexcept;
  Hdf5Group& operator=(Hdf5Group&&) = delete;

  Hdf5Group create_group(const std::string& name);

  void write_number(const std::string& name, double value);
  void write_integer(const std::string& name, std::int64_t value);
  /// Writes a text: as an attribute, or as an array of one text if it is longer than attributes
  /// are.
  void write_text(const std::string& name, const std::string& value);

  template <typename T>
  void write_array(const std::string& name, std::span<const T> values);
  /// Writes an array of `size` floats that comes in pieces, from the first element on. `source` is
  /// called once and hands each piece to the sink that it receives.
  using FloatSink = std::function<void(std::span<const float>)>;
  void write_floats(const std::string& name, std::size_t size,
                    const std::function<void(const FloatSink&)>& source);

 private:
  std::string path_of(const std::string& name) const;
  void count_attribute();
  void count_member();
  template <typename T>
  void write_scalar(const std::string& name, T value);

  std::string file_, name_;
  std::int64_t id_;
  int num_attributes_ = 0, num_members_ = 0;
};

/// An HDF5 file that is being written.
class Hdf5File {
 public:
  /// Creates an empty file and replaces any that exists.
  static Hdf5File create(const std::filesystem::path& path);
  /// Creates an empty file that stays in memory, to find out how large it becomes.
  static Hdf5File create_in_memory();
  ~Hdf5File();
  Hdf5File(Hdf5File&& other) noexcept;
  Hdf5File& operator=(Hdf5File&&) = delete;

  Hdf5Group root() const;
  /// Returns the bytes of what was written so far.
  std::size_t size() const;
  /// Writes everything to the disk. Throws Error if the disk does not take it.
  void close();

 private:
  Hdf5File(std::string path, std::int64_t id) : path_(std::move(path)), id_(id) {}
  static Hdf5File create(const std::string& path, std::int64_t access);
  std::string path_;
  std::int64_t id_;
};

}  // namespace tomofield::io
