#include "io/hdf5/hdf5_file.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <cstdlib>
#include <new>
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
// HDF5 keeps attributes of 64 KiB and more in another form, which tomofield does not read.
constexpr std::size_t kLongestAttribute = 60000;
constexpr int kMostOfAGroup = 8;  // HDF5's default for compact storage

constexpr int kMemoryOfAFile = 1 << 20;  // bytes; the cache of a file has about 200 KiB

// Sets up HDF5 once, before any other call of it.
void set_up_library() {
  [[maybe_unused]] static const bool is_done = [] {
    // HDF5 1.10 crashes at program exit if a file could not be closed for lack of disk space.
    // Files are closed here explicitly, so HDF5 has nothing to do at exit.
    H5dont_atexit();
    // The cache of the first file is kept for those that follow.
    H5set_free_list_limits(kMemoryOfAFile, kMemoryOfAFile, 0, 0, 0, 0);
    return true;
  }();
}

// Silences HDF5, which prints its errors by default; a library must never print.
class QuietErrors {
 public:
  QuietErrors() {
    set_up_library();
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietErrors() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
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

// Throws std::bad_alloc unless there is the memory that HDF5 takes for a file. HDF5 1.10 crashes if
// it cannot allocate its cache.
void require_memory_of_a_file() {
  void* memory = std::malloc(kMemoryOfAFile);
  if (memory == nullptr) throw std::bad_alloc();
  *static_cast<volatile char*>(memory) = 0;  // else the compiler leaves the allocation out
  std::free(memory);
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
  // Closes the handle now. Returns false if what HDF5 still held of it cannot be written: the
  // values of a small dataset reach the file only here.
  bool finish() { return close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }

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
template <>
struct Stored<std::uint8_t> {
  static hid_t in_memory() { return H5T_NATIVE_UINT8; }
  static hid_t in_file() { return H5T_STD_U8LE; }
};

[[noreturn]] void fail_writing(const std::string& file, const std::string& item) {
  throw Error(fmt::format("cannot write '{}' of '{}': {}", item, file, last_reason()));
}

// Returns the access properties of a file: the format whose metadata all have checksums, and no
// locks of HDF5's own. A file is written under a temporary name and never changes afterwards, and
// on clusters there are file systems whose locks fail.
Handle file_access() {
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110);
  H5Pset_file_locking(access, false, true);
  return {access, H5Pclose};
}

// Returns the creation properties of an item of class `kind`. They exclude times, so that the same
// contents are the same bytes.
Handle creation(hid_t kind) {
  const hid_t properties = H5Pcreate(kind);
  H5Pset_obj_track_times(properties, false);
  return {properties, H5Pclose};
}

// Returns the type of a text of fixed length; texts of variable length lie in a heap without
// checksum.
Handle text_type(const std::string& value) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, value.size() + 1);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return {type, H5Tclose};
}

void write_text_attribute(hid_t owner, const std::string& name, const std::string& value,
                          const std::string& file, const std::string& item) {
  const Handle type = text_type(value);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate2(owner, name.c_str(), type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute || H5Awrite(attribute.id(), type.id(), value.c_str()) < 0)
    fail_writing(file, item);
}

std::string text_of(std::uint64_t checksum) { return fmt::format("{:016x}", checksum); }

}  // namespace

Hdf5Group::Hdf5Group(std::string file, std::string name, std::int64_t id)
    : file_(std::move(file)), name_(std::move(name)), id_(id) {}

Hdf5Group::Hdf5Group(Hdf5Group&& other) noexcept
    : file_(std::move(other.file_)),
      name_(std::move(other.name_)),
      id_(std::exchange(other.id_, H5I_INVALID_HID)),
      num_attributes_(other.num_attributes_),
      num_members_(other.num_members_) {}

Hdf5Group::~Hdf5Group() {
  if (id_ >= 0) H5Gclose(id_);
}

std::string Hdf5Group::path_of(const std::string& name) const {
  TOMOFIELD_CHECK(!name.empty() && name.find('/') == std::string::npos,
                  fmt::format("'{}' is no name of an HDF5 item", name));
  return name_ + "/" + name;
}

void Hdf5Group::count_attribute() {
  TOMOFIELD_CHECK(++num_attributes_ <= kMostOfAGroup, name_ + " has too many attributes");
}

void Hdf5Group::count_member() {
  TOMOFIELD_CHECK(++num_members_ <= kMostOfAGroup, name_ + " has too many members");
}

Hdf5Group Hdf5Group::create_group(const std::string& name) {
  count_member();
  const QuietErrors quiet;
  const Handle properties = creation(H5P_GROUP_CREATE);
  const hid_t id = H5Gcreate2(id_, name.c_str(), H5P_DEFAULT, properties.id(), H5P_DEFAULT);
  if (id < 0) fail_writing(file_, path_of(name));
  return {file_, path_of(name), id};
}

template <typename T>
void Hdf5Group::write_scalar(const std::string& name, T value) {
  count_attribute();
  const QuietErrors quiet;
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate2(id_, name.c_str(), Stored<T>::in_file(), space.id(), H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  if (!attribute || H5Awrite(attribute.id(), Stored<T>::in_memory(), &value) < 0)
    fail_writing(file_, path_of(name));
}

void Hdf5Group::write_number(const std::string& name, double value) { write_scalar(name, value); }
void Hdf5Group::write_integer(const std::string& name, std::int64_t value) {
  write_scalar(name, value);
}
void Hdf5Group::write_text(const std::string& name, const std::string& value) {
  const QuietErrors quiet;
  if (value.size() <= kLongestAttribute) {
    count_attribute();
    return write_text_attribute(id_, name, value, file_, path_of(name));
  }
  count_member();
  const Handle type = text_type(value);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle layout = creation(H5P_DATASET_CREATE);
  Handle dataset(
      H5Dcreate2(id_, name.c_str(), type.id(), space.id(), H5P_DEFAULT, layout.id(), H5P_DEFAULT),
      H5Dclose);
  if (!dataset ||
      H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, value.c_str()) < 0)
    fail_writing(file_, path_of(name));
  const std::span<const char> with_end(value.c_str(), value.size() + 1);
  write_text_attribute(dataset.id(), kChecksum, text_of(base::xxhash64(std::as_bytes(with_end))),
                       file_, path_of(name));
  if (!dataset.finish()) fail_writing(file_, path_of(name));
}

template <typename T>
void Hdf5Group::write_array(const std::string& name, std::span<const T> values) {
  count_member();
  const QuietErrors quiet;
  const hsize_t size = values.size();
  const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const Handle layout = creation(H5P_DATASET_CREATE);
  const hid_t dataset = H5Dcreate2(id_, name.c_str(), Stored<T>::in_file(), space.id(), H5P_DEFAULT,
                                   layout.id(), H5P_DEFAULT);
  Handle closing(dataset, H5Dclose);
  if (dataset < 0 ||
      H5Dwrite(dataset, Stored<T>::in_memory(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    fail_writing(file_, path_of(name));
  write_text_attribute(dataset, kChecksum, text_of(base::xxhash64(std::as_bytes(values))), file_,
                       path_of(name));
  if (!closing.finish()) fail_writing(file_, path_of(name));
}

void Hdf5Group::write_floats(const std::string& name, std::size_t size,
                             const std::function<void(const FloatSink&)>& source) {
  count_member();
  const QuietErrors quiet;
  const hsize_t all = size;
  const Handle space(H5Screate_simple(1, &all, nullptr), H5Sclose);
  const Handle layout = creation(H5P_DATASET_CREATE);
  const hid_t dataset = H5Dcreate2(id_, name.c_str(), H5T_IEEE_F32LE, space.id(), H5P_DEFAULT,
                                   layout.id(), H5P_DEFAULT);
  Handle closing(dataset, H5Dclose);
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
  if (!closing.finish()) fail_writing(file_, path_of(name));
}

template void Hdf5Group::write_array(const std::string&, std::span<const float>);
template void Hdf5Group::write_array(const std::string&, std::span<const double>);
template void Hdf5Group::write_array(const std::string&, std::span<const std::int64_t>);
template void Hdf5Group::write_array(const std::string&, std::span<const std::uint8_t>);

Hdf5File Hdf5File::create(const std::filesystem::path& path) {
  require_memory_of_a_file();
  const QuietErrors quiet;
  return create(path.string(), file_access().id());
}

Hdf5File Hdf5File::create_in_memory() {
  constexpr std::size_t kStep = 256;  // bytes by which the file grows
  require_memory_of_a_file();
  const QuietErrors quiet;
  const Handle access = file_access();
  H5Pset_fapl_core(access.id(), kStep, false);
  return create("a file in memory", access.id());
}

Hdf5File Hdf5File::create(const std::string& path, std::int64_t access) {
  const Handle properties = creation(H5P_FILE_CREATE);
  const hid_t id = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, properties.id(), access);
  if (id < 0) throw Error(fmt::format("cannot write '{}': {}", path, last_reason()));
  return {path, id};
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
  if (id < 0) fail_writing(path_, "/");
  return {path_, "", id};
}

std::size_t Hdf5File::size() const {
  const QuietErrors quiet;
  hsize_t bytes = 0;
  if (H5Fflush(id_, H5F_SCOPE_GLOBAL) < 0 || H5Fget_filesize(id_, &bytes) < 0)
    throw Error(fmt::format("cannot write '{}': {}", path_, last_reason()));
  return bytes;
}

void Hdf5File::close() {
  const QuietErrors quiet;
  if (H5Fclose(std::exchange(id_, H5I_INVALID_HID)) < 0)
    throw Error(fmt::format("cannot write '{}': {}", path_, last_reason()));
}

}  // namespace tomofield::io
