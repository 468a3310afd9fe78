#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string_view>

#include "cli/commands.h"
#include "cli/input_options.h"
#include "cli/model_info.h"
#include "io/mrc.h"
#include "io/mrc_format.h"
#include "io/positioned_file.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::cli {
namespace {

enum class FileKind { kMrc, kHdf5 };

/// Returns the kind of a file by its first bytes, never by its name.
FileKind kind_of(const std::filesystem::path& path) {
  constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";
  const io::PositionedFile file(path, io::PositionedFile::Access::kRead);
  std::array<char, kHdf5Signature.size()> start{};
  if (file.size() >= static_cast<std::int64_t>(start.size())) {
    file.read_at(0, start.data(), start.size());
  }
  return std::string_view(start.data(), start.size()) == kHdf5Signature ? FileKind::kHdf5
                                                                        : FileKind::kMrc;
}

void print_voxel_size(const io::MrcHeader& header) {
  const auto& size_A = header.voxel_size_A;
  if (std::all_of(size_A.begin(), size_A.end(), [](double size) { return size == 0.0; })) {
    fmt::print("  voxel size       not given\n");
    return;
  }
  fmt::print("  voxel size       {:.7g} × {:.7g} × {:.7g} Å\n", size_A[0], size_A[1], size_A[2]);
}

void print_extended_header(const io::MrcHeader& header) {
  if (header.extended_header_bytes == 0) {
    fmt::print("  extended header  none\n");
    return;
  }
  fmt::print("  extended header  {} bytes of type '{}'\n", header.extended_header_bytes,
             header.extended_header_type);
  const auto& tilts = header.extended_tilt_deg;
  if (tilts.empty()) return;
  const auto [low, high] = std::minmax_element(tilts.begin(), tilts.end());
  fmt::print("  tilt angles      {} in the extended header, {}° to {}°\n", tilts.size(), *low,
             *high);
}

void print_mrc(const std::filesystem::path& path) {
  const io::MrcReader reader(path);
  const io::MrcHeader& header = reader.header();
  fmt::print("{}: MRC {}\n", path.string(), header.is_volume ? "volume" : "image stack");
  fmt::print("  size             {} × {} × {} (x, y, sections)\n", header.nx, header.ny, header.nz);
  fmt::print("  values           {}{}, {}-endian\n", io::describe(header.mode),
             header.bytes_are_unsigned ? " read as unsigned (IMOD's stamp)" : "",
             header.is_byte_swapped ? "big" : "little");
  print_voxel_size(header);
  fmt::print("  origin           {:.7g}, {:.7g}, {:.7g} Å\n", header.origin_A[0],
             header.origin_A[1], header.origin_A[2]);
  fmt::print("  in the header    minimum {:.7g}, maximum {:.7g}, mean {:.7g}, rms {:.7g}\n",
             header.min, header.max, header.mean, header.rms);
  print_extended_header(header);
  for (const std::string& label : header.labels) fmt::print("  label            {}\n", label);
}

void print_series(const tilt_series::TiltSeriesOptions& options) {
  const tilt_series::TiltSeries series(options);
  fmt::print("  as a tilt series {} views of {} × {} pixels of {:.7g} Å, tilt axis along y\n",
             series.views().size(), series.width(), series.height(), series.pixel_size_A());
  if (options.contrast == Contrast::kDark) {
    fmt::print("  empty beam       {:.7g}\n", series.empty_beam());
  }
  const tilt_series::MaskFigures& masks = series.mask_figures();
  fmt::print("  masked           {} beads of {:.3g} nm, {} hot or dead pixels\n", masks.num_beads,
             masks.bead_diameter_A / 10, masks.num_bad_pixels);
  fmt::print("  section  tilt/°  x-tilt/°  noise\n");
  for (std::size_t i = 0; i < series.views().size(); ++i) {
    const tilt_series::View& view = series.views()[i];
    fmt::print("  {:7}  {:6.2f}  {:8.2f}  {:.5g}\n", view.section + 1, view.tilt_deg,
               view.x_tilt_deg, series.noise_sigma()[i]);
  }
}

void print_info(const tilt_series::TiltSeriesOptions& options) {
  switch (kind_of(options.stack)) {
    case FileKind::kHdf5:
      return print_model(options.stack);
    case FileKind::kMrc:
      print_mrc(options.stack);
      if (options.tlt || options.aln || options.mdoc) print_series(options);
  }
}

}  // namespace

void add_info_command(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "info",
      "Show the contents of a file; with tilt angles (--tlt, --aln, --mdoc) also check it as a "
      "tilt series and list its views");
  auto options = std::make_shared<tilt_series::TiltSeriesOptions>();
  add_input_options(*command, *options);
  command->callback([options] { print_info(*options); });
}

}  // namespace tomofield::cli
