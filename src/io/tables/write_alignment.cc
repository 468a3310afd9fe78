#include "io/tables/write_alignment.h"

#include <fmt/format.h>

#include <string>

#include "base/check.h"
#include "io/saving/atomic_file.h"

namespace tomofield::io {
namespace {

// Adding 0 drops the sign of −0.
double unsigned_zero(double value) { return value + 0.0; }

}  // namespace

void write_number_column(const std::filesystem::path& path, std::span<const double> angles_deg) {
  std::string text;
  for (const double angle_deg : angles_deg)
    text += fmt::format("{:.4f}\n", unsigned_zero(angle_deg));
  write_text_file(path, text);
}

void write_imod_transforms(const std::filesystem::path& path,
                           std::span<const ImodTransform> transforms) {
  std::string text;
  for (const ImodTransform& t : transforms) {
    text +=
        fmt::format("{:12.7f} {:11.7f} {:11.7f} {:11.7f} {:11.3f} {:11.3f}\n", unsigned_zero(t.a11),
                    unsigned_zero(t.a12), unsigned_zero(t.a21), unsigned_zero(t.a22),
                    unsigned_zero(t.shift_x_px), unsigned_zero(t.shift_y_px));
  }
  write_text_file(path, text);
}

void write_mdoc(const std::filesystem::path& path, const Mdoc& mdoc) {
  std::string text;
  const auto add = [&](const char* key, const std::optional<double>& value) {
    if (value) text += fmt::format("{} = {:.4f}\n", key, unsigned_zero(*value));
  };
  add("PixelSpacing", mdoc.pixel_spacing_A);
  if (!mdoc.image_file.empty()) text += fmt::format("ImageFile = {}\n", mdoc.image_file);
  for (const MdocSection& section : mdoc.sections) {
    text += fmt::format("\n[ZValue = {}]\n", section.section);
    add("TiltAngle", section.tilt_deg);
    add("ExposureDose", section.dose);
    add("PriorRecordDose", section.prior_dose);
  }
  write_text_file(path, text);
}

void write_aretomo_alignment(const std::filesystem::path& path, const AreTomoAlignment& alignment) {
  TOMOFIELD_CHECK(alignment.raw_size && !alignment.rows.empty() &&
                      alignment.dark_tilt_deg.size() == alignment.dark_sections.size(),
                  "an .aln file needs the size of the stack, rows, and tilts of dark frames");
  const auto& [nx, ny, nz] = *alignment.raw_size;
  std::string text = "# AreTomo Alignment / Priims bprmMn\n";
  text += fmt::format("# RawSize = {} {} {}\n# NumPatches = 0\n", nx, ny, nz);
  for (std::size_t i = 0; i < alignment.dark_sections.size(); ++i) {
    text += fmt::format("# DarkFrame = {0:5} {0:5} {1:9.4f}\n", alignment.dark_sections[i],
                        unsigned_zero(alignment.dark_tilt_deg[i]));
  }
  text += fmt::format("# AlphaOffset = {:8.4f}\n# BetaOffset = {:8.4f}\n",
                      unsigned_zero(alignment.alpha_offset_deg),
                      unsigned_zero(alignment.beta_offset_deg));
  if (alignment.thickness) text += fmt::format("# Thickness = {:.3f}\n", *alignment.thickness);
  text +=
      "# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     BASE     "
      "TILT\n";
  for (const AreTomoRow& row : alignment.rows) {
    text += fmt::format(
        "{:5} {:11.5f} {:10.5f} {:11.3f} {:11.3f}     1.00     1.00     1.00     0.00 {:9.4f}\n",
        row.section, unsigned_zero(row.rotation_deg), row.magnification,
        unsigned_zero(row.shift_x_px), unsigned_zero(row.shift_y_px), unsigned_zero(row.tilt_deg));
  }
  write_text_file(path, text);
}

}  // namespace tomofield::io
