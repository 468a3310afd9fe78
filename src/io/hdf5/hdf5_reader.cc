#include "io/hdf5/hdf5_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "base/check.h"
#include "base/system/memory.h"
#include "base/xxhash64.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using Type = Hdf5Values::Type;

constexpr const char* kChecksum = "xxh64";

template <typename T>
constexpr Type type_of() {
  if constexpr (std::is_same_v<T, float>)
    return Type::kFloat32;
  else if constexpr (std::is_same_v<T, double>)
    return Type::kFloat64;
  else if constexpr (std::is_same_v<T, std::uint8_t>)
    return Type::kByte;
  else
    return Type::kInteger64;
}

template <typename T>
T first(const Hdf5Attribute& attribute) {
  T value{};
  TOMOFIELD_CHECK(attribute.bytes.size() >= sizeof value, "the attribute has a value");
  std::memcpy(&value, attribute.bytes.data(), sizeof value);
  return value;
}

std::optional<double> number_in(const Hdf5Attribute& attribute) {
  switch (attribute.values.type) {
    case Type::kFloat32:
      return static_cast<double>(first<float>(attribute));
    case Type::kFloat64:
      return first<double>(attribute);
    case Type::kInteger64:
      return static_cast<double>(first<std::int64_t>(attribute));
    case Type::kByte:
    case Type::kText:
      break;
  }
  return std::nullopt;
}

std::string without_padding(std::string text) {
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

}  // namespace

void StoredGroup::fail(const std::string& name, const std::string& reason) const {
  throw Error(fmt::format(
      "'{}': '{}' cannot be read ({}); the file is damaged or incomplete, so use another copy",
      file_->file.path().string(), path_ + "/" + name, reason));
}

const Hdf5Object& StoredGroup::child(const std::string& name) const {
  const auto found = object_->children.find(name);
  if (found == object_->children.end()) fail(name, "it is missing");
  return found->second;
}

StoredGroup StoredGroup::group(const std::string& name) const {
  const Hdf5Object& found = child(name);
  if (found.array) fail(name, "it is no group");
  return {file_, found, path_ + "/" + name};
}

bool StoredGroup::has(const std::string& name) const { return object_->children.contains(name); }

bool StoredGroup::has_attribute(const std::string& name) const {
  return object_->attributes.contains(name);
}

std::vector<std::string> StoredGroup::names() const {
  std::vector<std::string> found;
  for (const auto& [name, object] : object_->children) found.push_back(name);
  return found;
}

const Hdf5Attribute& StoredGroup::value(const std::string& name) const {
  const auto found = object_->attributes.find(name);
  if (found == object_->attributes.end()) fail(name, "it is missing");
  if (found->second.values.count != 1) fail(name, "it is not one value");
  return found->second;
}

base::Finite StoredGroup::number(const std::string& name, base::Interval within) const {
  const Hdf5Attribute& found = value(name);
  const std::optional<double> stored = number_in(found);
  if (!stored) fail(name, "it is no number");
  if (const auto number = within.find(*stored)) return *number;
  fail(name,
       fmt::format("it is {}, not a number from {} to {}", *stored, within.low(), within.high()));
}

std::int64_t StoredGroup::integer(const std::string& name) const {
  const Hdf5Attribute& found = value(name);
  if (found.values.type != Type::kInteger64) fail(name, "it is no integer of 64 bits");
  return first<std::int64_t>(found);
}

std::string StoredGroup::text(const std::string& name) const {
  if (!has_attribute(name) && has(name)) {
    const Hdf5Object& found = array_of(name, Type::kText);
    if (found.array->count != 1) fail(name, "it is not one text");
    require_room(name);
    std::string bytes(found.array->bytes_each, '\0');
    file_->file.read_at(found.address, bytes.data(), bytes.size());
    require_checksum(name, found, base::xxhash64(std::as_bytes(std::span(bytes))));
    return without_padding(std::move(bytes));
  }
  const Hdf5Attribute& found = value(name);
  if (found.values.type != Type::kText) fail(name, "it is not a text of fixed length");
  return without_padding(found.bytes);
}

const Hdf5Object& StoredGroup::array(const std::string& name) const {
  const Hdf5Object& found = child(name);
  if (!found.array) fail(name, "it is no array");
  return found;
}

const Hdf5Object& StoredGroup::array_of(const std::string& name, Type type) const {
  const Hdf5Object& found = array(name);
  if (found.array->type != type) fail(name, "its elements are of another type");
  return found;
}

std::size_t StoredGroup::array_size(const std::string& name) const {
  const Hdf5Object& found = array(name);
  if (found.array->rank != 1) fail(name, "it is not a one-dimensional array");
  return found.array->count;
}

void StoredGroup::require_room(const std::string& name) const {
  constexpr std::size_t kSmall = std::size_t{16} << 20;
  const Hdf5Values& values = *array(name).array;
  const std::size_t bytes = values.count * values.bytes_each;
  if (bytes <= kSmall) return;
  const std::string what =
      fmt::format("'{}': '{}'", file_->file.path().string(), path_ + "/" + name);
  base::require_memory(bytes, what.c_str(), "use a machine with more, or another copy");
}

void StoredGroup::require_checksum(const std::string& name, const Hdf5Object& array,
                                   std::uint64_t found) const {
  const auto stored = array.attributes.find(kChecksum);
  if (stored == array.attributes.end()) fail(name, "it has no checksum");
  const std::string wanted = without_padding(stored->second.bytes);
  const std::string text = fmt::format("{:016x}", found);
  if (text != wanted)
    fail(name, fmt::format("its checksum is {} instead of {}", text, wanted.substr(0, 16)));
}

void StoredGroup::read_floats(const std::string& name, const FloatSink& sink) const {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  const Hdf5Object& found = array_of(name, Type::kFloat32);
  std::size_t left = array_size(name);
  std::int64_t at = found.address;
  std::vector<float> piece;
  base::Xxhash64 checksum;
  for (; left > 0; left -= piece.size()) {
    piece.resize(std::min(kPiece, left));
    const auto bytes = std::as_writable_bytes(std::span(piece));
    file_->file.read_at(at, bytes.data(), bytes.size());
    at += static_cast<std::int64_t>(bytes.size());
    checksum.add(bytes);
    sink(piece);
  }
  require_checksum(name, found, checksum.value());
}

template <typename T>
void StoredGroup::read_array(const std::string& name, std::span<T> values) const {
  const std::size_t size = array_size(name);
  if (size != values.size())
    fail(name, fmt::format("it has {} elements instead of {}", size, values.size()));
  const Hdf5Object& found = array_of(name, type_of<T>());
  const auto bytes = std::as_writable_bytes(values);
  if (!bytes.empty()) file_->file.read_at(found.address, bytes.data(), bytes.size());
  require_checksum(name, found, base::xxhash64(bytes));
}

template void StoredGroup::read_array(const std::string&, std::span<float>) const;
template void StoredGroup::read_array(const std::string&, std::span<double>) const;
template void StoredGroup::read_array(const std::string&, std::span<std::int64_t>) const;
template void StoredGroup::read_array(const std::string&, std::span<std::uint8_t>) const;

Hdf5Reader::Hdf5Reader(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    throw Error(fmt::format("'{}' does not exist: check the path", name));
  PositionedFile file(path, PositionedFile::Access::kRead);
  if (!has_hdf5_signature(path)) throw Error(fmt::format("'{}' is no HDF5 file", name));
  try {
    Hdf5Object root = read_hdf5_objects(file);
    file_ = std::make_shared<const StoredGroup::File>(
        StoredGroup::File{std::move(file), std::move(root)});
  } catch (const ForeignHdf5& error) {
    throw Error(
        fmt::format("'{}' is an HDF5 file and no model of tomofield (or a damaged one): {}. A "
                    "stack must be MRC or "
                    "TIFF: convert it with IMOD's newstack -format MRC or EMAN2's e2proc2d.py",
                    name, error.what()));
  } catch (const Error& error) {
    throw Error(fmt::format(
        "'{}' is damaged or incomplete, or was not written by tomofield: {}; use another copy",
        name, error.what()));
  }
}

StoredGroup Hdf5Reader::root() const { return {file_, file_->root, ""}; }

bool has_hdf5_signature(const std::filesystem::path& path) {
  constexpr std::array<char, 8> kSignature{'\x89', 'H', 'D', 'F', '\r', '\n', '\x1a', '\n'};
  std::array<char, 8> found{};
  try {
    const PositionedFile file(path, PositionedFile::Access::kRead);
    file.read_at(0, found.data(), found.size());
  } catch (const Error&) {
    return false;
  }
  return found == kSignature;
}

}  // namespace tomofield::io
