#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/check.h"
#include "io/images/mrc.h"
#include "io/images/mrc_extended.h"
#include "io/images/mrc_format.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

struct MrcReader::Impl {
  PositionedFile file;
  MrcHeader header;

  explicit Impl(const std::filesystem::path& path) : file(path, PositionedFile::Access::kRead) {
    const std::string name = path.string();
    const std::int64_t found = file.size();
    if (found < static_cast<std::int64_t>(kMrcHeaderBytes)) {
      throw Error(
          fmt::format("'{}' has {} bytes, less than an MRC header ({}); it is truncated or "
                      "no MRC file",
                      name, found, kMrcHeaderBytes));
    }
    MrcHeaderBytes bytes;
    file.read_at(0, bytes.data(), bytes.size());
    header = decode_mrc_header(bytes, name);
    const std::int64_t expected = expected_file_bytes(header, name);
    if (found < expected) {
      throw Error(fmt::format(
          "'{}' is truncated: {} × {} × {} values of {} and {} bytes of extended header make {} "
          "bytes, but the file has {}; copy it again, or correct its header",
          name, header.nx, header.ny, header.nz, describe(header.mode),
          header.extended_header_bytes, expected, found));
    }
    read_extended_header(bytes);
  }

  void read_extended_header(const MrcHeaderBytes& bytes) {
    const ExtendedRecords records = find_extended_records(bytes, header);
    if (records.layout == ExtendedLayout::kNone) return;
    // Files of several megabytes of metadata have records for no more than some thousand sections.
    constexpr std::int64_t kMostBytes = std::int64_t{1} << 24;
    if (records.bytes_per_section * header.nz > kMostBytes) return;
    std::vector<std::byte> extended(
        static_cast<std::size_t>(std::min(header.extended_header_bytes, kMostBytes)));
    file.read_at(kMrcHeaderBytes, extended.data(), extended.size());
    read_extended_records(extended, records, header);
  }
};

MrcReader::MrcReader(const std::filesystem::path& path) : impl_(std::make_unique<Impl>(path)) {}
MrcReader::~MrcReader() = default;
MrcReader::MrcReader(MrcReader&&) noexcept = default;
MrcReader& MrcReader::operator=(MrcReader&&) noexcept = default;

const MrcHeader& MrcReader::header() const { return impl_->header; }
const std::filesystem::path& MrcReader::path() const { return impl_->file.path(); }

void MrcReader::read_section(std::int64_t section, std::span<float> out) const {
  read_rows(section, 0, impl_->header.ny, out);
}

void MrcReader::read_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                          std::span<float> out) const {
  const MrcHeader& header = impl_->header;
  TOMOFIELD_CHECK(
      section >= 0 && section < header.nz && first_row >= 0 && num_rows >= 0 &&
          first_row + num_rows <= header.ny,
      fmt::format("rows {}+{} of section {} are outside the file", first_row, num_rows, section));
  TOMOFIELD_CHECK(out.size() == static_cast<std::size_t>(num_rows * header.nx),
                  "the output must have as many values as the rows");
  // A megabyte at a time keeps the raw bytes in the cache while they are converted.
  constexpr std::size_t kChunkValues = std::size_t{1} << 18;
  const std::size_t width = bytes_per_value(header.mode);
  std::vector<std::byte> raw(std::min(kChunkValues, out.size()) * width);
  std::int64_t offset =
      static_cast<std::int64_t>(kMrcHeaderBytes) + header.extended_header_bytes +
      (section * header.ny + first_row) * header.nx * static_cast<std::int64_t>(width);
  while (!out.empty()) {
    const std::size_t count = std::min(kChunkValues, out.size());
    const std::span<std::byte> chunk = std::span(raw).first(count * width);
    impl_->file.read_at(offset, chunk.data(), chunk.size());
    decode_values(header, chunk, out.first(count));
    out = out.subspan(count);
    offset += static_cast<std::int64_t>(chunk.size());
  }
}

}  // namespace tomofield::io
