#include "realign/alignment_origin_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/xxhash64.h"
#include "io/images/image_stack.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "measurement/view_transfers.h"
#include "options/options_record.h"
#include "tilt_series/planned_series.h"
#include "tomofield/error.h"

namespace tomofield::realign {
namespace {

using nlohmann::json;

std::string hex(std::uint64_t checksum) { return fmt::format("{:016x}", checksum); }

// Returns the small files that decide how the views are read and aligned, by their names in the
// options.
std::vector<std::pair<const char*, std::filesystem::path>> small_files(const SeriesFiles& files) {
  std::vector<std::pair<const char*, std::filesystem::path>> all;
  const auto add = [&](const char* name, const std::optional<std::filesystem::path>& file) {
    if (file) all.emplace_back(name, *file);
  };
  add("tlt", files.tlt);
  add("xf", files.xf);
  add("xtilt", files.xtilt);
  add("local", files.local);
  add("aln", files.aln);
  add("mdoc", files.mdoc);
  add("fiducials", files.fiducials);
  if (measurement::has_ctf_file(files)) add("ctf", files.ctf);
  add("mtf", files.mtf);
  if (!files.stack.empty() && io::is_view_table(files.stack))
    add("stack", io::without_half(files.stack));
  return all;
}

std::map<std::string, std::string> checksums_of_files(const SeriesFiles& files) {
  std::map<std::string, std::string> sums;
  for (const auto& [name, file] : small_files(files)) {
    const std::string text = io::read_small_file(file);
    sums[name] = hex(base::xxhash64(std::as_bytes(std::span(text))));
  }
  return sums;
}

// Returns a checksum of the first, the middle and the last section that is used.
std::string checksum_of_pixels(const io::ImageStack& stack, const std::string& excluded) {
  const io::MrcHeader& header = stack.header();
  const auto unused = io::parse_section_list(excluded, header.nz);
  std::vector<std::int64_t> used;
  for (std::int64_t section = 0; section < header.nz; ++section)
    if (!std::ranges::binary_search(unused, section)) used.push_back(section);
  if (used.empty()) return hex(0);
  std::vector<float> image(static_cast<std::size_t>(header.nx * header.ny));
  base::Xxhash64 sum;
  for (const std::int64_t section : std::set{used.front(), used[used.size() / 2], used.back()}) {
    stack.read_section(section, image);
    sum.add(std::as_bytes(std::span(image)));
  }
  return hex(sum.value());
}

// Returns the options that decide what the alignment finds.
json relevant_options(const options::ReconstructOptions& options) {
  json all = options::options_json(options);
  json& input = all["input"];
  for (const char* unused : {"stack", "even", "odd"}) input.erase(unused);
  for (const auto& named : small_files(options.files)) input.erase(named.first);
  const FieldOptions field = alignment::planned_field(options.field);
  return {{"input", input},
          {"specimen", all["specimen"]},
          {"align", all["fit"]["align"]},
          {"seed", options.fit.seed},
          {"field",
           {{"with_margin", field.with_margin},
            {"margin_spacing", field.margin_spacing},
            {"vertex_spacing", field.vertex_spacing},
            {"activation", all["field"]["activation"]}}}};
}

}  // namespace

alignment::AlignmentOrigin alignment_origin(const options::ReconstructOptions& options) {
  const auto stack = tilt_series::open_views(options.input());
  const io::MrcHeader& header = stack->header();
  const std::span tilts(header.extended_tilt_deg);
  return {.num_sections = header.nz,
          .size_px = {header.nx, header.ny},
          .files = checksums_of_files(options.files),
          .header_tilts = hex(base::xxhash64(std::as_bytes(tilts))),
          .pixels = checksum_of_pixels(*stack, options.views.exclude),
          .made_with = relevant_options(options)};
}

alignment::AlignmentRecord read_alignment_record(const std::filesystem::path& path,
                                                 const alignment::AlignmentOrigin& origin,
                                                 const std::vector<std::int64_t>& sections) {
  try {
    alignment::AlignmentRecord record = alignment::read_record(path);
    if (const std::string why = alignment::difference_of(record.origin, origin); !why.empty())
      throw Error(why);
    if (!std::ranges::equal(record.views, sections, {}, &alignment::AlignedView::section))
      throw Error(fmt::format("its {} views are not the {} of the series", record.views.size(),
                              sections.size()));
    return record;
  } catch (const std::exception& error) {
    throw Error(
        fmt::format("cannot resume from the alignment '{}': {}; to start over, give --overwrite "
                    "instead of --resume",
                    path.string(), error.what()));
  }
}

void apply_alignment(const alignment::AlignmentRecord& record,
                     options::ReconstructOptions& options) {
  auto& corrections = options.corrections;
  corrections.assign(static_cast<std::size_t>(record.origin.num_sections), {});
  for (const alignment::AlignedView& view : record.views) {
    corrections[static_cast<std::size_t>(view.section)] = view.correction();
    if (view.is_left_out) options.left_out.push_back(view.section);
  }
  options.alignment = record;
}

}  // namespace tomofield::realign
