#include "io/hdf5_file.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <type_traits>
#include <utility>

#include "base/check.h"
#include "base/xxhash64.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

static_assert(std::is_same_v<hid_t, std::int64_t>, "handles are passed as 64-bit integers");

constexpr const char* kChecksum = "xxh64";

// Is set once metadata turned out to be damaged. HDF5 1.10 then cannot close the file, and prints
// so when the program ends, unless errors are still quiet.
bool must_stay_quiet = false;

// Silences HDF5, which prints its errors by default; a library must never print.
class QuietErrors {
 public:
  QuietErrors() {
    // HDF5 1.10 crashes at program exit if a file could not be closed for lack of disk space.
    // Files are closed here explicitly, so HDF5 has nothing to do at exit.
    [[maybe_unused]] static const herr_t never_at_exit = H5dont_atexit();
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietErrors() {
    if (!must_stay_quiet) H5Eset_auto2(H5E_DEFAULT, function_, data_);
  }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

// Returns the innermost message of the last failure, which names the cause.
std::string last_reason() {
  std::string reason;
  const auto visit = [](unsigned depth, const H5E_error2_t* error, void* out) -> herr_t {
    if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(out) = error->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, visit, &reason);
  // HDF5 reports failed system calls with all their arguments; the system's own message is enough.
  constexpr std::string_view kSystemMessage = "error message = '";
  const std::size_t message = reason.find(kSystemMessage);
  if (message != std::string::npos) {
    const std::string said = reason.substr(message + kSystemMessage.size());
    reason = said.substr(0, said.find('\''));
  }
  return reason.empty() ? "unknown reason" : reason;
}

// Owns a handle of any kind.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  hid_t id() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

template <typename T>
struct Stored;
template <>
struct Stored<float> {
  static hid_t in_memory() { return H5T_NATIVE_FLOAT; }
  static hid_t in_file() { return H5T_IEEE_F32LE; }
};
template <>
struct Stored<double> {
  static hid_t in_memory() { return H5T_NATIVE_DOUBLE; }
  static hid_t in_file() { return H5T_IEEE_F64LE; }
};
template <>
struct Stored<std::int64_t> {
  static hid_t in_memory() { return H5T_NATIVE_INT64; }
  static hid_t in_file() { return H5T_STD_I64LE; }
};

[[noreturn]] void fail_writing(const std::string& file, const std::string& item) {
  throw Error(
      fmt::format("cannot write '{}' of '{}' ({}): is the disk full?", item, file, last_reason()));
}

[[noreturn]] void fail_reading(const std::string& file, const std::string& item,
                               const std::string& reason) {
  must_stay_quiet = true;
  throw Error(fmt::format(
      "'{}': '{}' cannot be read ({}); the file is damaged or incomplete, so use another copy",
      file, item, reason));
}

// Returns the access properties of a file: the format whose metadata all have checksums, and no
// error if the file system has no locks, as on clusters.
Handle file_access() {
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110);
  H5Pset_file_locking(access, true, true);
  return {access, H5Pclose};
}

// Returns the creation properties of an item of class `kind`. They exclude times, so that the same
// contents are the same bytes.
Handle creation(hid_t kind) {
  const hid_t properties = H5Pcreate(kind);
  H5Pset_obj_track_times(properties, false);
  return {properties, H5Pclose};
}

// Writes a text of fixed length; texts of variable length lie in a heap without checksum.
void write_text_attribute(hid_t owner, const std::string& name, const std::string& value,
                          const std::string& file, const std::string& item) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), value.size() + 1);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate2(owner, name.c_str(), type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute || H5Awrite(attribute.id(), type.id(), value.c_str()) < 0)
    fail_writing(file, item);
}

std::string read_text_attribute(hid_t owner, const std::string& name, const std::string& file,
                                const std::string& item) {
  const Handle attribute(H5Aopen(owner, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute) fail_reading(file, item, last_reason());
  const Handle type(H5Aget_type(attribute.id()), H5Tclose);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) != 0 ||
      H5Sget_simple_extent_npoints(space.id()) != 1)
    fail_reading(file, item, "it is not a text of fixed length");
  std::string value(H5Tget_size(type.id()), '\0');
  if (H5Aread(attribute.id(), type.id(), value.data()) < 0) fail_reading(file, item, last_reason());
  value.resize(std::min(value.find('\0'), value.size()));
  return value;
}

std::string text_of(std::uint64_t checksum) { return fmt::format("{:016x}", checksum); }

void require_checksum(hid_t dataset, const std::string& found, const std::string& file,
                      const std::string& item) {
  const std::string stored = read_text_attribute(dataset, kChecksum, file, item + "." + kChecksum);
  if (found != stored)
    fail_reading(file, item, fmt::format("its checksum is {} instead of {}", found, stored));
}

}  // namespace

Hdf5Group::Hdf5Group(std::string file, std::string name, std::int64_t id)
    : file_(std::move(file)), name_(std::move(name)), id_(id) {}

Hdf5Group::Hdf5Group(Hdf5Group&& other) noexcept
    : file_(std::move(other.file_)),
      name_(std::move(other.name_)),
      id_(std::exchange(other.id_, H5I_INVALID_HID)) {}

Hdf5Group::~Hdf5Group() {
  if (id_ >= 0) H5Gclose(id_);
}

std::string Hdf5Group::path_of(const std::string& name) const {
  TOMOFIELD_CHECK(!name.empty() && name.find('/') == std::string::npos,
                  fmt::format("'{}' is no name of an HDF5 item", name));
  return name_ + "/" + name;
}

Hdf5Group Hdf5Group::create_group(const std::string& name) {
  const QuietErrors quiet;
  const Handle properties = creation(H5P_GROUP_CREATE);
  const hid_t id = H5Gcreate2(id_, name.c_str(), H5P_DEFAULT, properties.id(), H5P_DEFAULT);
  if (id < 0) fail_writing(file_, path_of(name));
  return {file_, path_of(name), id};
}

Hdf5Group Hdf5Group::group(const std::string& name) const {
  const QuietErrors quiet;
  const hid_t id = H5Gopen2(id_, name.c_str(), H5P_DEFAULT);
  if (id < 0) fail_reading(file_, path_of(name), last_reason());
  return {file_, path_of(name), id};
}

bool Hdf5Group::has(const std::string& name) const {
  const QuietErrors quiet;
  const htri_t found = H5Lexists(id_, name.c_str(), H5P_DEFAULT);
  if (found < 0) fail_reading(file_, path_of(name), last_reason());
  return found > 0;
}

bool Hdf5Group::has_attribute(const std::string& name) const {
  const QuietErrors quiet;
  const htri_t found = H5Aexists(id_, name.c_str());
  if (found < 0) fail_reading(file_, path_of(name), last_reason());
  return found > 0;
}

std::vector<std::string> Hdf5Group::names() const {
  const QuietErrors quiet;
  std::vector<std::string> found;
  const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  if (H5Literate(id_, H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &found) < 0)
    fail_reading(file_, name_, last_reason());
  std::sort(found.begin(), found.end());
  return found;
}

template <typename T>
void Hdf5Group::write_scalar(const std::string& name, T value) {
  const QuietErrors quiet;
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate2(id_, name.c_str(), Stored<T>::in_file(), space.id(), H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  if (!attribute || H5Awrite(attribute.id(), Stored<T>::in_memory(), &value) < 0)
    fail_writing(file_, path_of(name));
}

template <typename T>
T Hdf5Group::read_scalar(const std::string& name) const {
  const QuietErrors quiet;
  const Handle attribute(H5Aopen(id_, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute) fail_reading(file_, path_of(name), last_reason());
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  if (H5Sget_simple_extent_npoints(space.id()) != 1)
    fail_reading(file_, path_of(name), "it is not one value");
  T value{};
  if (H5Aread(attribute.id(), Stored<T>::in_memory(), &value) < 0)
    fail_reading(file_, path_of(name), last_reason());
  return value;
}

void Hdf5Group::write_number(const std::string& name, double value) { write_scalar(name, value); }
void Hdf5Group::write_integer(const std::string& name, std::int64_t value) {
  write_scalar(name, value);
}
double Hdf5Group::number(const std::string& name) const { return read_scalar<double>(name); }
std::int64_t Hdf5Group::integer(const std::string& name) const {
  return read_scalar<std::int64_t>(name);
}

void Hdf5Group::write_text(const std::string& name, const std::string& value) {
  const QuietErrors quiet;
  write_text_attribute(id_, name, value, file_, path_of(name));
}

std::string Hdf5Group::text(const std::string& name) const {
  const QuietErrors quiet;
  return read_text_attribute(id_, name, file_, path_of(name));
}

template <typename T>
void Hdf5Group::write_array(const std::string& name, std::span<const T> values) {
  const QuietErrors quiet;
  const hsize_t size = values.size();
  const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const Handle layout = creation(H5P_DATASET_CREATE);
  const hid_t dataset = H5Dcreate2(id_, name.c_str(), Stored<T>::in_file(), space.id(), H5P_DEFAULT,
                                   layout.id(), H5P_DEFAULT);
  const Handle closing(dataset, H5Dclose);
  if (dataset < 0 ||
      H5Dwrite(dataset, Stored<T>::in_memory(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    fail_writing(file_, path_of(name));
  write_text_attribute(dataset, kChecksum, text_of(base::xxhash64(std::as_bytes(values))), file_,
                       path_of(name));
}

void Hdf5Group::write_floats(const std::string& name, std::size_t size,
                             const std::function<void(const FloatSink&)>& source) {
  const QuietErrors quiet;
  const hsize_t all = size;
  const Handle space(H5Screate_simple(1, &all, nullptr), H5Sclose);
  const Handle layout = creation(H5P_DATASET_CREATE);
  const hid_t dataset = H5Dcreate2(id_, name.c_str(), H5T_IEEE_F32LE, space.id(), H5P_DEFAULT,
                                   layout.id(), H5P_DEFAULT);
  const Handle closing(dataset, H5Dclose);
  if (dataset < 0) fail_writing(file_, path_of(name));
  hsize_t at = 0;
  base::Xxhash64 checksum;
  source([&](std::span<const float> piece) {
    TOMOFIELD_CHECK(at + piece.size() <= size, "pieces make the array");
    const hsize_t count = piece.size();
    if (count == 0) return;
    const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, &at, nullptr, &count, nullptr);
    if (H5Dwrite(dataset, H5T_NATIVE_FLOAT, memory.id(), space.id(), H5P_DEFAULT, piece.data()) < 0)
      fail_writing(file_, path_of(name));
    checksum.add(std::as_bytes(piece));
    at += count;
  });
  TOMOFIELD_CHECK(at == size, "pieces make the array");
  write_text_attribute(dataset, kChecksum, text_of(checksum.value()), file_, path_of(name));
}

void Hdf5Group::read_floats(const std::string& name, const FloatSink& sink) const {
  constexpr hsize_t kPiece = hsize_t{1} << 20;
  const hsize_t size = array_size(name);
  const QuietErrors quiet;
  const Handle dataset(H5Dopen2(id_, name.c_str(), H5P_DEFAULT), H5Dclose);
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  if (H5Tequal(type.id(), H5T_IEEE_F32LE) <= 0)
    fail_reading(file_, path_of(name), "its elements are of another type");
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  std::vector<float> piece;
  base::Xxhash64 checksum;
  for (hsize_t at = 0; at < size; at += piece.size()) {
    const hsize_t count = std::min(kPiece, size - at);
    piece.resize(count);
    const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, &at, nullptr, &count, nullptr);
    if (H5Dread(dataset.id(), H5T_NATIVE_FLOAT, memory.id(), space.id(), H5P_DEFAULT,
                piece.data()) < 0)
      fail_reading(file_, path_of(name), last_reason());
    checksum.add(std::as_bytes(std::span<const float>(piece)));
    sink(piece);
  }
  require_checksum(dataset.id(), text_of(checksum.value()), file_, path_of(name));
}

std::size_t Hdf5Group::array_size(const std::string& name) const {
  const QuietErrors quiet;
  const Handle dataset(H5Dopen2(id_, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset) fail_reading(file_, path_of(name), last_reason());
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  if (H5Sget_simple_extent_ndims(space.id()) != 1)
    fail_reading(file_, path_of(name), "it is not a one-dimensional array");
  const auto size = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.id()));
  // A damaged size must be refused before memory is allocated for it.
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  if (H5Dget_storage_size(dataset.id()) / H5Tget_size(type.id()) < size)
    fail_reading(file_, path_of(name), "it is shorter than it says");
  return size;
}

template <typename T>
void Hdf5Group::read_array(const std::string& name, std::span<T> values) const {
  const std::size_t size = array_size(name);
  if (size != values.size())
    fail_reading(file_, path_of(name),
                 fmt::format("it has {} elements instead of {}", size, values.size()));
  const QuietErrors quiet;
  const Handle dataset(H5Dopen2(id_, name.c_str(), H5P_DEFAULT), H5Dclose);
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  if (H5Tequal(type.id(), Stored<T>::in_file()) <= 0)
    fail_reading(file_, path_of(name), "its elements are of another type");
  if (size > 0 && H5Dread(dataset.id(), Stored<T>::in_memory(), H5S_ALL, H5S_ALL, H5P_DEFAULT,
                          values.data()) < 0)
    fail_reading(file_, path_of(name), last_reason());
  require_checksum(dataset.id(), text_of(base::xxhash64(std::as_bytes(values))), file_,
                   path_of(name));
}

template void Hdf5Group::write_array(const std::string&, std::span<const float>);
template void Hdf5Group::write_array(const std::string&, std::span<const double>);
template void Hdf5Group::write_array(const std::string&, std::span<const std::int64_t>);
template void Hdf5Group::read_array(const std::string&, std::span<float>) const;
template void Hdf5Group::read_array(const std::string&, std::span<double>) const;
template void Hdf5Group::read_array(const std::string&, std::span<std::int64_t>) const;

Hdf5File Hdf5File::create(const std::filesystem::path& path) {
  const QuietErrors quiet;
  const Handle access = file_access();
  const Handle properties = creation(H5P_FILE_CREATE);
  const hid_t id = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, properties.id(), access.id());
  if (id < 0) throw Error(fmt::format("cannot write '{}': {}", path.string(), last_reason()));
  return {path.string(), id};
}

Hdf5File Hdf5File::open(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path))
    throw Error(fmt::format("'{}' does not exist: check the path", path.string()));
  if (!std::filesystem::is_regular_file(path) || !std::ifstream(path, std::ios::binary))
    throw Error(fmt::format("'{}' is no file that can be read: check its kind and permissions",
                            path.string()));
  if (!has_hdf5_signature(path)) throw Error(fmt::format("'{}' is no HDF5 file", path.string()));
  const QuietErrors quiet;
  const Handle access = file_access();
  const hid_t id = H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id());
  if (id < 0)
    throw Error(fmt::format("'{}' is damaged or incomplete ({}); use another copy", path.string(),
                            last_reason()));
  return {path.string(), id};
}

Hdf5File::Hdf5File(Hdf5File&& other) noexcept
    : path_(std::move(other.path_)), id_(std::exchange(other.id_, H5I_INVALID_HID)) {}

Hdf5File::~Hdf5File() {
  const QuietErrors quiet;
  if (id_ >= 0) H5Fclose(id_);
}

Hdf5Group Hdf5File::root() const {
  const QuietErrors quiet;
  const hid_t id = H5Gopen2(id_, "/", H5P_DEFAULT);
  if (id < 0) fail_reading(path_, "/", last_reason());
  return {path_, "", id};
}

void Hdf5File::close() {
  const QuietErrors quiet;
  if (H5Fclose(std::exchange(id_, H5I_INVALID_HID)) < 0)
    throw Error(fmt::format("cannot write '{}': {}", path_, last_reason()));
}

bool has_hdf5_signature(const std::filesystem::path& path) {
  constexpr std::array<char, 8> kSignature{'\x89', 'H', 'D', 'F', '\r', '\n', '\x1a', '\n'};
  std::array<char, 8> found{};
  std::ifstream file(path, std::ios::binary);
  return file.read(found.data(), found.size()) && found == kSignature;
}

}  // namespace tomofield::io
