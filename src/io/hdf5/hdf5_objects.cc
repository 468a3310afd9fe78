#include "io/hdf5/hdf5_objects.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "base/plausible.h"
#include "io/hdf5/lookup3.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are read as they lie there");

constexpr std::uint64_t kUndefined = std::numeric_limits<std::uint64_t>::max();
constexpr std::size_t kChecksumBytes = 4;
// tomofield's own files have four levels, and headers of a few KiB.
constexpr int kDeepest = 8;
constexpr std::uint64_t kLargestHeader = std::uint64_t{16} << 20;

// The messages of an object's header (section IV.A.2 of the format's specification).
enum class Message : int {
  kNil = 0x00,
  kDataspace = 0x01,
  kLinkInfo = 0x02,
  kDatatype = 0x03,
  kOldFillValue = 0x04,
  kFillValue = 0x05,
  kLink = 0x06,
  kExternalFiles = 0x07,
  kLayout = 0x08,
  kGroupInfo = 0x0A,
  kFilters = 0x0B,
  kAttribute = 0x0C,
  kContinuation = 0x10,
  kSymbolTable = 0x11,
  kAttributeInfo = 0x15,
};

[[noreturn]] void refuse_feature(std::string_view what) {
  throw ForeignHdf5(fmt::format("it has {}, which tomofield does not write", what));
}
void require(bool condition, std::string_view what) {
  if (!condition) throw Error(std::string(what));
}

// Takes numbers and texts from some bytes, one after the other.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : rest_(bytes) {}

  std::string_view bytes(std::uint64_t count) {
    require(count <= rest_.size(), "a part of it ends too early");
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }
  void skip(std::uint64_t count) { bytes(count); }
  // Returns a number of 1 to 8 bytes, the lowest first.
  std::uint64_t number(std::size_t width) {
    std::uint64_t value = 0;
    const std::string_view raw = bytes(width);
    std::memcpy(&value, raw.data(), width);
    return value;
  }
  int byte() { return static_cast<int>(number(1)); }
  std::size_t size() const { return rest_.size(); }

 private:
  std::string_view rest_;
};

// Gives out the bytes of a file, none of them twice. So no part can refer to itself, and all parts
// together are no larger than the file.
class Regions {
 public:
  explicit Regions(const PositionedFile& file) : file_(file), end_(file.size()) {}

  void claim(std::uint64_t address, std::uint64_t bytes) {
    const auto end = static_cast<std::uint64_t>(end_);
    require(address <= end && bytes <= end - address, "a part of it lies beyond its end");
    if (bytes == 0) return;
    const auto next = claimed_.lower_bound(address);
    const bool is_free = (next == claimed_.end() || address + bytes <= next->first) &&
                         (next == claimed_.begin() || std::prev(next)->second <= address);
    require(is_free, "two parts of it overlap");
    claimed_.emplace_hint(next, address, address + bytes);
  }

  // Claims and reads a part that ends with its checksum, and returns it without that.
  std::string read_checked(std::uint64_t address, std::uint64_t bytes) {
    require(bytes >= kChecksumBytes && bytes <= kLargestHeader, "a header has a wrong size");
    claim(address, bytes);
    std::string text(bytes, '\0');
    file_.read_at(static_cast<std::int64_t>(address), text.data(), text.size());
    std::uint32_t stored = 0;
    std::memcpy(&stored, text.data() + bytes - kChecksumBytes, kChecksumBytes);
    text.resize(bytes - kChecksumBytes);
    require(lookup3(text) == stored, "a checksum is wrong");
    return text;
  }

  // Reads bytes that read_checked() will claim, to learn how many they are.
  std::string peek(std::uint64_t address, std::uint64_t most) const {
    const auto end = static_cast<std::uint64_t>(end_);
    require(address < end, "a part of it lies beyond its end");
    std::string text(std::min(most, end - address), '\0');
    file_.read_at(static_cast<std::int64_t>(address), text.data(), text.size());
    return text;
  }
  std::uint64_t file_size() const { return static_cast<std::uint64_t>(end_); }

 private:
  const PositionedFile& file_;
  std::int64_t end_;
  std::map<std::uint64_t, std::uint64_t> claimed_;  // end of each part, by its beginning
};

// Reads the superblock and returns the address of the root group's header.
std::uint64_t read_superblock(Regions& regions) {
  constexpr std::uint64_t kSuperblockBytes = 48;
  constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";
  const std::string start = regions.peek(0, kSignature.size() + 1);
  require(start.starts_with(kSignature) && start.size() > kSignature.size(), "it is no HDF5 file");
  const int version = start.back();
  if (version != 2 && version != 3)
    refuse_feature(fmt::format("version {} of HDF5's superblock", version));
  const std::string block = regions.read_checked(0, kSuperblockBytes);
  Cursor at(std::string_view(block).substr(kSignature.size() + 1));
  if (at.byte() != 8 || at.byte() != 8)
    refuse_feature("addresses or lengths of other than 8 bytes");
  require(at.byte() == 0, "it was not closed by the program that wrote it");
  if (at.number(8) != 0) refuse_feature("another base address");
  if (at.number(8) != kUndefined) refuse_feature("an extended superblock");
  const std::uint64_t end = at.number(8);
  require(end <= regions.file_size(),
          fmt::format("it is truncated: it has {} of {} bytes", regions.file_size(), end));
  return at.number(8);
}

Hdf5Values read_type(Cursor at) {
  const int class_and_version = at.byte();
  const auto bits = at.number(3);
  const auto bytes = static_cast<std::size_t>(at.number(4));
  const auto properties = at.bytes(std::min<std::size_t>(at.size(), 12));
  using Type = Hdf5Values::Type;
  const auto is = [&](int type_class, std::uint64_t wanted_bits, std::size_t size,
                      std::string_view wanted) {
    return (class_and_version & 0x0F) == type_class && bits == wanted_bits && bytes == size &&
           properties.starts_with(wanted);
  };
  using namespace std::string_view_literals;
  // Bit offset, precision, then of floats the place and size of exponent and mantissa, and the
  // bias.
  if (is(1, 0x001F20, 4, "\0\0\x20\0\x17\x08\0\x17\x7F\0\0\0"sv))
    return {.type = Type::kFloat32, .bytes_each = 4};
  if (is(1, 0x003F20, 8, "\0\0\x40\0\x34\x0B\0\x34\xFF\x03\0\0"sv))
    return {.type = Type::kFloat64, .bytes_each = 8};
  if (is(0, 0x08, 8, "\0\0\x40\0"sv)) return {.type = Type::kInteger64, .bytes_each = 8};
  if (is(0, 0x00, 1, "\0\0\x08\0"sv)) return {.type = Type::kByte, .bytes_each = 1};
  constexpr std::size_t kLongestText = std::size_t{1} << 30;
  if ((class_and_version & 0x0F) == 3 && bytes > 0 && bytes <= kLongestText)
    return {.type = Type::kText, .bytes_each = bytes};
  refuse_feature("values of another type");
}

void read_space(Cursor at, Hdf5Values& values) {
  if (at.byte() != 2) refuse_feature("another version of a dataspace");
  values.rank = at.byte();
  at.skip(1);  // tells whether maximum sizes follow
  const int kind = at.byte();
  if (kind > 1 || (kind == 0) != (values.rank == 0) || values.rank > 1)
    refuse_feature("an array that is not one-dimensional");
  const std::uint64_t count = values.rank == 0 ? 1 : at.number(8);
  require((base::CheckedSize(count) * values.bytes_each).find().has_value(),
          "an array is impossibly large");
  values.count = static_cast<std::size_t>(count);
}

std::pair<std::string, Hdf5Attribute> read_attribute(Cursor at) {
  if (at.byte() != 3) refuse_feature("another version of an attribute");
  if (at.byte() != 0) refuse_feature("an attribute of a shared type");
  const auto name_bytes = at.number(2), type_bytes = at.number(2), space_bytes = at.number(2);
  at.skip(1);  // encoding of the name
  std::string name(at.bytes(name_bytes));
  name.resize(std::min(name.find('\0'), name.size()));
  Hdf5Attribute attribute;
  attribute.values = read_type(Cursor(at.bytes(type_bytes)));
  read_space(Cursor(at.bytes(space_bytes)), attribute.values);
  require(attribute.values.count <= at.size() / attribute.values.bytes_each,
          "an attribute is shorter than it says");
  attribute.bytes = at.bytes(attribute.values.count * attribute.values.bytes_each);
  return {std::move(name), std::move(attribute)};
}

// Returns the name and the address that a hard link has.
std::pair<std::string, std::uint64_t> read_link(Cursor at) {
  if (at.byte() != 1) refuse_feature("another version of a link");
  const int flags = at.byte();
  const int kind = flags & 0x08 ? at.byte() : 0;
  if (kind != 0) refuse_feature(kind == 1 ? "a soft link" : "an external link");
  if (flags & 0x04) at.skip(8);  // order of creation
  if (flags & 0x10) at.skip(1);  // encoding of the name
  std::string name(at.bytes(at.number(std::size_t{1} << (flags & 0x03))));
  return {std::move(name), at.number(8)};
}

void require_compact(Cursor at, std::size_t index_bytes, std::string_view what) {
  at.skip(1);  // version
  const int flags = at.byte();
  if (flags & 0x01) at.skip(index_bytes);  // largest order of creation
  if (at.number(8) != kUndefined) refuse_feature(what);
}

// Reads the objects of a file, from the root on.
class ObjectReader {
 public:
  explicit ObjectReader(Regions& regions) : regions_(regions) {}

  Hdf5Object read(std::uint64_t address, int depth) {
    require(depth <= kDeepest, "its groups are nested too deeply");
    Header header = read_header(address);
    Hdf5Object object = std::move(header.object);
    if (header.type || header.layout) {
      place_array(header, object);
      require(header.links.empty(), "an array has members");
      return object;
    }
    for (const auto& [name, of_child] : header.links) {
      try {
        object.children.emplace(name, read(of_child, depth + 1));
      } catch (const Error& error) {
        throw Error(fmt::format("'{}': {}", quote(name), error.what()));
      }
    }
    return object;
  }

 private:
  // Holds what the messages of an object say.
  struct Header {
    Hdf5Object object;
    std::map<std::string, std::uint64_t> links;
    std::optional<std::string> type, space, layout;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> continuations;  // address and bytes
  };

  Header read_header(std::uint64_t address) {
    constexpr std::uint64_t kLongestPrefix = 34;
    const std::string prefix = regions_.peek(address, kLongestPrefix);
    if (!prefix.starts_with("OHDR")) refuse_feature("an object of an older format");
    Cursor at(std::string_view(prefix).substr(4));
    if (at.byte() != 2) refuse_feature("another version of an object");
    const int flags = at.byte();
    if (flags & 0x20) at.skip(16);  // times
    if (flags & 0x10) at.skip(4);   // limits of compact storage
    const std::uint64_t message_bytes = at.number(std::size_t{1} << (flags & 0x03));
    require(message_bytes <= kLargestHeader, "a header has a wrong size");
    const std::size_t prefix_bytes = prefix.size() - at.size();
    Header header;
    const bool has_order = (flags & 0x04) != 0;
    read_messages(regions_.read_checked(address, prefix_bytes + message_bytes + kChecksumBytes)
                      .substr(prefix_bytes),
                  has_order, header);
    for (std::size_t i = 0; i < header.continuations.size(); ++i) {
      const auto [next, bytes] = header.continuations[i];
      const std::string chunk = regions_.read_checked(next, bytes);
      require(chunk.starts_with("OCHK"), "a part of a header is missing");
      read_messages(chunk.substr(4), has_order, header);
    }
    return header;
  }

  static void read_messages(const std::string& bytes, bool has_order, Header& header) {
    const std::size_t head = has_order ? 6 : 4;
    for (Cursor at(bytes); at.size() >= head;) {  // less is a gap
      const auto kind = static_cast<Message>(at.byte());
      const std::uint64_t size = at.number(2);
      const int flags = at.byte();
      at.skip(head - 4);
      if ((flags & 0x02) && kind != Message::kNil) refuse_feature("a shared header message");
      read_message(kind, at.bytes(size), header);
    }
  }

  static void set_once(std::optional<std::string>& value, std::string_view bytes) {
    require(!value, "an array is described twice");
    value = bytes;
  }

  static void read_message(Message kind, std::string_view bytes, Header& header) {
    Cursor at(bytes);
    switch (kind) {
      case Message::kNil:
      case Message::kOldFillValue:
      case Message::kFillValue:
      case Message::kGroupInfo:
        return;
      case Message::kDataspace:
        return set_once(header.space, bytes);
      case Message::kDatatype:
        return set_once(header.type, bytes);
      case Message::kLayout:
        return set_once(header.layout, bytes);
      case Message::kLinkInfo:
        return require_compact(at, 8, "a group with many members");
      case Message::kAttributeInfo:
        return require_compact(at, 2, "an object with many attributes");
      case Message::kLink: {
        const bool is_new = header.links.insert(read_link(at)).second;
        return require(is_new, "two of its items have one name");
      }
      case Message::kAttribute: {
        const bool is_new = header.object.attributes.insert(read_attribute(at)).second;
        return require(is_new, "two of its attributes have one name");
      }
      case Message::kContinuation: {
        const std::uint64_t address = at.number(8);
        header.continuations.emplace_back(address, at.number(8));
        return;
      }
      case Message::kExternalFiles:
        refuse_feature("an array in another file");
      case Message::kFilters:
        refuse_feature("a filtered array");
      case Message::kSymbolTable:
        refuse_feature("a group of an older format");
    }
    refuse_feature(fmt::format("a header message of kind {}", static_cast<int>(kind)));
  }

  void place_array(const Header& header, Hdf5Object& object) {
    require(header.type && header.space && header.layout, "an array is described in part");
    Hdf5Values values = read_type(Cursor(*header.type));
    read_space(Cursor(*header.space), values);
    Cursor at(*header.layout);
    const int version = at.byte();
    if (version != 3 && version != 4) refuse_feature("another version of an array's layout");
    if (at.byte() != 1) refuse_feature("an array in chunks or in pieces of other files");
    const std::uint64_t address = at.number(8), bytes = at.number(8);
    require(bytes == values.count * values.bytes_each, "an array is shorter than it says");
    if (bytes > 0) {
      regions_.claim(address, bytes);
      object.address = static_cast<std::int64_t>(address);
    }
    object.array = values;
  }

  Regions& regions_;
};

}  // namespace

Hdf5Object read_hdf5_objects(const PositionedFile& file) {
  Regions regions(file);
  const std::uint64_t root = read_superblock(regions);
  Hdf5Object object = ObjectReader(regions).read(root, 0);
  require(!object.array, "its root is no group");
  return object;
}

}  // namespace tomofield::io
