#include "io/saving/output_files.h"

#include <fmt/format.h>

#include <array>
#include <map>
#include <system_error>
#include <utility>

#include "io/images/view_images.h"
#include "io/lower_extension.h"
#include "io/saving/file_identity.h"
#include "io/saving/output_target.h"
#include "io/tables/mdoc_images.h"
#include "io/tables/view_table.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

std::vector<fs::path>& other_inputs() {
  static std::vector<fs::path> files;
  return files;
}

// Adds the images that a stack which is a table, an .mdoc or a folder with --mdoc names. Where they
// cannot be found, none are added: the error says so when they are opened.
void add_listed_images(const fs::path& stack, const std::optional<fs::path>& mdoc,
                       std::vector<fs::path>& files) {
  const auto add = [&](const std::vector<ImageInFile>& images) {
    for (const ImageInFile& image : images) files.push_back(image.file);
  };
  const auto if_found = [](const auto& find) {
    try {
      find();
    } catch (const Error&) {
    }
  };
  std::error_code failed;
  if (is_view_table(stack)) {
    if_found([&] {
      const ViewTable table = read_view_table(stack);
      for (const Frames frames : {Frames::kAll, Frames::kEven, Frames::kOdd})
        if_found([&] { add(find_view_images(table, frames)); });
    });
  } else if (stack.extension() == ".mdoc") {
    if_found([&] { add(find_mdoc_images(stack, stack.parent_path())); });
  } else if (mdoc && fs::is_directory(stack, failed)) {
    if_found([&] { add(find_mdoc_images(*mdoc, stack)); });
  }
}

// Adds an input with the folders that it lies in: a store that is replaced takes all of itself
// away.
void add_with_folders(const fs::path& file, std::map<FileIdentity, fs::path>& read) {
  read.emplace(identity_of(file), file);
  std::error_code failed;
  fs::path inside = fs::weakly_canonical(end_of_links(file), failed);
  while (inside.has_relative_path()) {
    inside = inside.parent_path();
    read.emplace(identity_of(inside), file);
  }
}

}  // namespace

void add_input(const fs::path& file) { other_inputs().push_back(file); }

const std::vector<fs::path>& added_inputs() { return other_inputs(); }

void require_no_input_is_replaced(const std::vector<fs::path>& results,
                                  const std::vector<fs::path>& inputs) {
  std::map<FileIdentity, fs::path> read;
  for (const auto* files : {&inputs, &std::as_const(other_inputs())})
    for (const fs::path& file : *files) add_with_folders(file, read);
  for (const fs::path& result : results) {
    const auto input = read.find(identity_of(result));
    if (input == read.end()) continue;
    throw Error(
        fmt::format("the result '{}' would replace the input '{}': give another name or directory",
                    result.string(), input->second.string()));
  }
}

void require_distinct(const std::vector<fs::path>& results) {
  std::map<FileIdentity, fs::path> written;
  for (const fs::path& result : results) {
    const auto [same, is_new] = written.emplace(identity_of(result), result);
    if (is_new) continue;
    throw Error(fmt::format(
        "two results would both be '{}'{}: give them different names (a "
        "volume's ends in .mrc)",
        result.string(),
        same->second == result ? "" : fmt::format(", which is also '{}'", same->second.string())));
  }
}

void check_output_files(const std::vector<fs::path>& results, const std::vector<fs::path>& inputs,
                        bool may_replace, const std::string& advice) {
  require_distinct(results);
  require_no_input_is_replaced(results, inputs);
  for (const fs::path& result : results) {
    if (!may_replace && fs::is_regular_file(result))
      throw Error(fmt::format("'{}' exists: {}", result.string(), advice));
    require_writable(result);
  }
}

void require_volume_name(const std::filesystem::path& volume) {
  constexpr std::array<std::string_view, 5> kOfMrc{"", ".mrc", ".rec", ".map", ".ccp4"};
  if (std::ranges::find(kOfMrc, lower_extension(volume)) != kOfMrc.end()) return;
  throw Error(fmt::format(
      "the volume is an MRC file, and '{0}' ends in {1}: give a name in .mrc, .rec or .map, for "
      "example '{0}.mrc'",
      volume.string(), volume.extension().string()));
}

std::vector<fs::path> input_files(const SeriesFiles& input) {
  std::vector<fs::path> files{input.stack};
  for (const auto& stack : {std::optional(input.stack), input.even, input.odd})
    if (stack) add_listed_images(*stack, input.mdoc, files);
  for (const auto& file :
       {input.tlt, input.xf, input.xtilt, input.local, input.aln, input.mdoc, input.fiducials,
        input.mask, input.even, input.odd, input.ctf, input.mtf}) {
    if (file) files.push_back(*file);
  }
  return files;
}

}  // namespace tomofield::io
