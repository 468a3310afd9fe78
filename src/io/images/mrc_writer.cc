#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <system_error>

#include "base/check.h"
#include "base/log.h"
#include "base/plausible.h"
#include "base/progress.h"
#include "base/system/memory.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_target.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// The mean and the sum of squared deviations of one row. They are kept for every row (a thousandth
// of the file) and combined in the file's order at the end. The header is therefore the same
// whichever thread wrote which row and when.
struct RowMoments {
  double mean = 0.0;
  double squares = 0.0;
};

RowMoments moments_of(std::span<const float> row) {
  const auto count = static_cast<double>(row.size());
  double sum = 0.0;
  for (const float value : row) sum += value;
  RowMoments moments{sum / count, 0.0};
  for (const float value : row) moments.squares += (value - moments.mean) * (value - moments.mean);
  return moments;
}

float largest_magnitude(std::span<const float> values) {
  float largest = 0.0f;
  for (const float value : values)
    if (std::isfinite(value)) largest = std::max(largest, std::fabs(value));
  return largest;
}

MrcHeader header_of(const MrcSpec& spec, const std::string& name) {
  constexpr std::int64_t kLargest = std::numeric_limits<std::int32_t>::max();
  for (const std::int64_t size : {spec.nx, spec.ny, spec.nz}) {
    if (size < 1 || size > kLargest) {
      throw Error(fmt::format("cannot write '{}': an MRC file cannot have {} × {} × {} values",
                              name, spec.nx, spec.ny, spec.nz));
    }
  }
  MrcHeader header;
  header.nx = spec.nx;
  header.ny = spec.ny;
  header.nz = spec.nz;
  header.mode = spec.mode;
  header.voxel_size_A = spec.voxel_size_A;
  header.origin_A = spec.origin_A;
  header.is_volume = spec.is_volume;
  header.sections_a_volume = spec.sections_a_volume;
  header.labels = spec.labels;
  return header;
}

// Returns room for the moments of all rows. Throws Error if it is more than the memory.
std::vector<RowMoments> moments_of_rows(const MrcHeader& header, const std::string& name) {
  constexpr std::size_t kSmall = std::size_t{1} << 24;
  const std::size_t rows =
      static_cast<std::size_t>(header.ny) * static_cast<std::size_t>(header.nz);
  const auto bytes = (base::CheckedSize(rows) * sizeof(RowMoments)).find();
  const std::size_t needed = bytes ? static_cast<std::size_t>(*bytes) : SIZE_MAX;
  if (needed > kSmall)
    base::require_memory(needed, fmt::format("writing '{}'", name).c_str(),
                         "make a smaller volume, or write it in parts");
  return std::vector<RowMoments>(rows);
}

}  // namespace

struct MrcWriter::Impl {
  MrcHeader header;
  const distributed::Communicator& processes;
  std::optional<AtomicFile> target;  // only on the root
  std::optional<PositionedFile> file;

  std::mutex mutex;  // guards the members below
  std::vector<RowMoments> rows;
  std::int64_t num_rows_written = 0;
  float min = std::numeric_limits<float>::infinity();
  float max = -std::numeric_limits<float>::infinity();
  float largest = 0.0f;  // finite magnitude, before it was stored as a float of 16 bits

  Impl(const std::filesystem::path& path, const MrcSpec& spec, const distributed::Communicator& all)
      : header(header_of(spec, path.string())), processes(all) {
    std::filesystem::path temporary;
    std::int64_t bytes = 0;
    processes.run_collectively([&] {
      if (!processes.is_root()) return;
      target.emplace(path);
      temporary = target->temporary_path();
      bytes = expected_file_bytes(header, path.string());
      require_room(folder_of(temporary), path, bytes);
    });
    processes.run_collectively([&] {
      rows = moments_of_rows(header, path.string());
      if (!processes.is_root()) return;
      file.emplace(temporary, PositionedFile::Access::kReadWrite);
      file->resize(bytes);
    });
    temporary = processes.broadcast(temporary.string());
    processes.run_collectively([&] {
      if (!file) file.emplace(temporary, PositionedFile::Access::kReadWrite);
    });
  }

  void record(std::int64_t first_row, std::int64_t num_rows, std::span<const float> stored,
              std::span<const float> values) {
    const auto width = static_cast<std::size_t>(header.nx);
    std::vector<RowMoments> moments;
    for (std::size_t at = 0; at < stored.size(); at += width) {
      moments.push_back(moments_of(stored.subspan(at, width)));
    }
    const auto [low, high] = std::minmax_element(stored.begin(), stored.end());
    const float largest_here = header.mode == MrcMode::kFloat16 ? largest_magnitude(values) : 0.0f;
    const std::lock_guard lock(mutex);
    largest = std::max(largest, largest_here);
    std::copy(moments.begin(), moments.end(), rows.begin() + first_row);
    num_rows_written += num_rows;
    min = std::min(min, *low);
    max = std::max(max, *high);
  }

  // Combines the statistics of all ranks' rows.
  void share_statistics() {
    processes.allreduce_sum(std::span(rows), &RowMoments::mean, &RowMoments::squares);
    processes.allreduce_sum(std::span(&num_rows_written, 1));
    min = -static_cast<float>(processes.allreduce_max(-static_cast<double>(min)));
    max = static_cast<float>(processes.allreduce_max(static_cast<double>(max)));
    largest = static_cast<float>(processes.allreduce_max(static_cast<double>(largest)));
  }

  // Warns of values that floats of 16 bits cut off, or hold in a few steps.
  void warn_of_half_floats() const {
    constexpr float kFewestSteps = 256.0f;
    const bool is_small = largest > 0.0f && largest < kFewestSteps * kSmallestHalf;
    if (largest <= kLargestHalf && !is_small) return;
    base::log_warning(fmt::format(
        "'{}' has values of up to {:.3g}, and its 16-bit floats {}: write 32-bit floats (--mode 2)",
        target->path().string(), largest,
        is_small ? fmt::format("are multiples of {:.1g}", kSmallestHalf)
                 : fmt::format("end at {}", kLargestHalf)));
  }

  void finish_statistics() {
    const auto num_rows = static_cast<double>(rows.size());
    double sum = 0.0;
    for (const RowMoments& row : rows) sum += row.mean;
    header.mean = sum / num_rows;
    double squares = 0.0;  // every row has the same number of values
    for (const RowMoments& row : rows) {
      const double shift = row.mean - header.mean;
      squares += row.squares + shift * shift * static_cast<double>(header.nx);
    }
    if (!std::isfinite(squares)) return header.leave_statistics_undetermined();
    header.rms = std::sqrt(squares / (num_rows * static_cast<double>(header.nx)));
    const bool has_unwritten_zeros = num_rows_written < static_cast<std::int64_t>(rows.size());
    header.min = has_unwritten_zeros ? std::min(min, 0.0f) : min;
    header.max = has_unwritten_zeros ? std::max(max, 0.0f) : max;
  }
};

MrcWriter::MrcWriter(const std::filesystem::path& path, const MrcSpec& spec,
                     const distributed::Communicator& processes)
    : impl_(std::make_unique<Impl>(path, spec, processes)) {}
MrcWriter::~MrcWriter() = default;
MrcWriter::MrcWriter(MrcWriter&&) noexcept = default;

void MrcWriter::write_section(std::int64_t section, std::span<const float> values) {
  write_rows(section, 0, impl_->header.ny, values);
}

void MrcWriter::write_sections(std::int64_t first, std::span<const float> values) {
  const MrcHeader& header = impl_->header;
  const auto plane = static_cast<std::size_t>(header.nx * header.ny);
  const auto count = static_cast<std::int64_t>(values.size() / plane);
  TOMOFIELD_CHECK(values.size() % plane == 0 && first >= 0 && first + count <= header.nz,
                  fmt::format("{} values from section {} on are no sections of the file",
                              values.size(), first));
  for (std::size_t at = 0; at < values.size(); at += plane)
    write_section(first + static_cast<std::int64_t>(at / plane), values.subspan(at, plane));
}

void MrcWriter::write_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                           std::span<const float> values) {
  base::allow_interruption();
  const MrcHeader& header = impl_->header;
  TOMOFIELD_CHECK(
      section >= 0 && section < header.nz && first_row >= 0 && num_rows >= 0 &&
          first_row + num_rows <= header.ny,
      fmt::format("rows {}+{} of section {} are outside the file", first_row, num_rows, section));
  TOMOFIELD_CHECK(values.size() == static_cast<std::size_t>(num_rows * header.nx),
                  "there must be as many values as the rows have");
  const auto row_values = static_cast<std::size_t>(header.nx);
  const std::size_t width = bytes_per_value(header.mode);
  const std::int64_t chunk_rows = std::max<std::int64_t>(1, (std::int64_t{1} << 18) / header.nx);
  std::vector<std::byte> raw;
  std::vector<float> stored;
  for (std::int64_t row = 0; row < num_rows; row += chunk_rows) {
    const std::int64_t count = std::min(chunk_rows, num_rows - row);
    const auto chunk = values.subspan(static_cast<std::size_t>(row) * row_values,
                                      static_cast<std::size_t>(count) * row_values);
    raw.resize(chunk.size() * width);
    stored.resize(chunk.size());
    encode_values(header.mode, chunk, raw, stored);
    const std::int64_t file_row = section * header.ny + first_row + row;
    impl_->file->write_at(static_cast<std::int64_t>(kMrcHeaderBytes) +
                              file_row * header.nx * static_cast<std::int64_t>(width),
                          raw.data(), raw.size());
    impl_->record(file_row, count, stored, chunk);
  }
}

void MrcWriter::close() {
  impl_->processes.run_collectively([&] {
    if (!impl_->processes.is_root()) impl_->file->close();
  });
  impl_->share_statistics();
  impl_->processes.run_collectively([&] {
    if (!impl_->processes.is_root()) return;
    impl_->finish_statistics();
    impl_->warn_of_half_floats();
    const MrcHeaderBytes bytes = encode_mrc_header(impl_->header);
    impl_->file->write_at(0, bytes.data(), bytes.size());
    impl_->file->close();
    impl_->target->commit();
  });
}

}  // namespace tomofield::io
