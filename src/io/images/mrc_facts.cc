#include "io/images/mrc_facts.h"

#include "io/images/mrc_format.h"
#include "io/is_file.h"
#include "io/saving/positioned_file.h"

namespace tomofield::io {

std::optional<MrcFacts> find_mrc_facts(const std::filesystem::path& path, const MrcHeader& header) {
  if (!is_file(path)) return std::nullopt;
  const PositionedFile file(path, PositionedFile::Access::kRead);
  const std::int64_t beyond = file.size() - expected_file_bytes(header, path.string());
  if (beyond < 0) return std::nullopt;
  MrcHeaderBytes bytes;
  file.read_at(0, bytes.data(), bytes.size());
  const auto voxel_size_A = stated_voxel_size_A(bytes, header);
  if (!voxel_size_A) return std::nullopt;
  const auto width = static_cast<std::int64_t>(bytes_per_value(header.mode));
  return MrcFacts{*voxel_size_A, beyond / (header.nx * header.ny * width)};
}

}  // namespace tomofield::io
