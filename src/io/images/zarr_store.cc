#include "io/images/zarr_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "io/images/zarr_array.h"
#include "io/json.h"
#include "io/saving/atomic_folder.h"
#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

bool is_one_of(std::string_view name, std::initializer_list<std::string_view> names) {
  return std::ranges::find(names, name) != names.end();
}

// Says whether a name is a number below `end`, as std::to_string() writes it.
bool is_number_below(const std::string& name, std::int64_t end) {
  for (const char digit : name)
    if (digit < '0' || digit > '9') return false;
  constexpr std::size_t kMostDigits = 9;
  if (name.empty() || name.size() > kMostDigits) return false;
  return std::stoll(name) < end && name == std::to_string(std::stoll(name));
}

using Counts = std::array<std::int64_t, 3>;  // z, y, x

Counts count_chunks(const nlohmann::json& array) {
  constexpr double kMostVoxels = 1e9;
  const std::vector<double> shape = numbers_at(array, "shape", 1, kMostVoxels);
  Counts counts{};
  if (shape.size() != counts.size()) throw Error("it has not three axes");
  std::ranges::transform(shape, counts.begin(), [](double size) {
    return static_cast<std::int64_t>(std::ceil(size / static_cast<double>(ZarrArray::kSide)));
  });
  return counts;
}

// Returns what `read` makes of a description in a store.
template <typename Read>
auto read_in(const fs::path& store, const fs::path& file, const Read& read) {
  return read_record(store / file, read, [&](const std::string& why) {
    return fmt::format(
        "cannot replace '{}': its '{}' does not show that tomofield wrote it ({}); move the "
        "folder, or give another name",
        store.string(), file.string(), why);
  });
}

// Knows which entries a store of write_ome_zarr() has, since it reads the descriptions in the
// store.
class StoreContents {
 public:
  // Throws Error if there is no such description.
  explicit StoreContents(const fs::path& root)
      : is_3_(type_at(root / "zarr.json").type() == fs::file_type::regular) {
    read_in(root, kZarrMarker, [](const nlohmann::json& marker) { return marker.at("made_by"); });
    const auto num_levels =
        read_in(root, is_3_ ? "zarr.json" : ".zattrs", [&](nlohmann::json group) {
          if (is_3_) group = group.at("attributes").at("ome");
          return group.at("multiscales").at(0).at("datasets").size();
        });
    for (std::size_t level = 0; level < num_levels; ++level) {
      const fs::path description =
          fs::path(std::to_string(level)) / (is_3_ ? "zarr.json" : ".zarray");
      num_chunks_.push_back(read_in(root, description, count_chunks));
    }
  }

  // Says whether a store has an entry at a path that is relative to it.
  bool has(const fs::path& entry, bool is_folder) const {
    const std::vector<std::string> names(entry.begin(), entry.end());
    const auto num_levels = static_cast<std::int64_t>(num_chunks_.size());
    if (names.size() == 1 && !is_folder) return is_file_of_group(names[0]);
    if (!is_number_below(names[0], num_levels)) return false;
    return has_in_level(std::stoul(names[0]), std::span(names).subspan(1), is_folder);
  }

 private:
  bool is_file_of_group(const std::string& name) const {
    if (name == kZarrMarker) return true;
    return is_3_ ? name == "zarr.json" : is_one_of(name, {".zattrs", ".zgroup"});
  }

  // Chunks are files "z/y/x" of a level, or "c/z/y/x" in version 3.
  bool has_in_level(std::size_t level, std::span<const std::string> names, bool is_folder) const {
    if (names.empty()) return is_folder;
    if (names.size() == 1 && !is_folder) return names[0] == (is_3_ ? "zarr.json" : ".zarray");
    if (is_3_) {
      if (names[0] != "c") return false;
      names = names.subspan(1);
    }
    const Counts& counts = num_chunks_[level];
    if (names.size() > counts.size() || is_folder != (names.size() < counts.size())) return false;
    for (std::size_t axis = 0; axis < names.size(); ++axis)
      if (!is_number_below(names[axis], counts[axis])) return false;
    return true;
  }

  bool is_3_;
  std::vector<Counts> num_chunks_;  // of each level
};

}  // namespace

void require_replaceable_zarr(const fs::path& path) {
  require_replaceable_folder(path, kZarrMarker);
  if (type_at(path).type() == fs::file_type::not_found) return;
  const StoreContents contents(path);
  std::error_code failed;
  fs::recursive_directory_iterator entries(path, failed), end;
  for (; !failed && entries != end; entries.increment(failed)) {
    const fs::path entry = entries->path().lexically_relative(path);
    const fs::file_type type = type_at(entries->path()).type();
    const bool is_folder = type == fs::file_type::directory;
    if ((is_folder || type == fs::file_type::regular) && contents.has(entry, is_folder)) continue;
    throw Error(
        fmt::format("cannot replace '{}': it has '{}', which tomofield has not made; move one of "
                    "them away, or give another name",
                    path.string(), entry.string()));
  }
  if (failed)
    throw Error(fmt::format("cannot replace '{}': it cannot be looked through ({})", path.string(),
                            failed.message()));
}

}  // namespace tomofield::io
