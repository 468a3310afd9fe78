#include "io/images/view_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "io/is_file.h"
#include "io/named_file.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

// Returns the folders in which the names of `list` may begin, the likeliest first: its own, those
// above it, and the current one. They are relative to the current one if the list is.
std::vector<fs::path> roots_of(const fs::path& list) {
  std::error_code failed;
  const fs::path current = fs::current_path(failed);
  std::vector<fs::path> roots;
  fs::path folder = fs::absolute(list, failed).lexically_normal().parent_path();
  while (!failed) {
    const fs::path below = folder.lexically_relative(current);
    const bool is_below = list.is_relative() && !below.empty() && *below.begin() != "..";
    roots.push_back(folder == current ? fs::path() : is_below ? below : folder);
    if (folder == folder.parent_path()) break;
    folder = folder.parent_path();
  }
  if (std::ranges::find(roots, fs::path()) == roots.end()) roots.emplace_back();
  return roots;
}

std::optional<fs::path> look_for(const fs::path& name, std::span<const fs::path> roots) {
  const auto found = find_named_file(name.string(), roots);
  return found ? std::optional(found->lexically_normal()) : std::nullopt;
}

// Returns the name of the image that a row means.
std::string image_of(const ViewTable& table, std::size_t row, Frames frames) {
  const ListedView& view = table.views[row];
  if (frames == Frames::kAll) return view.image;
  const std::string& half = frames == Frames::kEven ? view.even : view.odd;
  if (!half.empty()) return half;
  throw Error(fmt::format("'{}', row {}: the table names no image of the {} frames",
                          table.file.string(), row + 1, frames == Frames::kEven ? "even" : "odd"));
}

// Returns the aligned average of a movie of Warp: DIR/average/NAME.mrc, or that of half of the
// frames, DIR/average/even/NAME.mrc.
fs::path average_of(const fs::path& movie, Frames frames) {
  fs::path folder = movie.parent_path() / "average";
  if (frames == Frames::kEven) folder /= "even";
  if (frames == Frames::kOdd) folder /= "odd";
  return folder / movie.filename().replace_extension(".mrc");
}

// Returns what a row names: an image, or a movie of Warp.
ImageInFile named_by(const ViewTable& table, std::size_t row, Frames frames) {
  return table.names_movies ? ImageInFile{table.views[row].image, std::nullopt}
                            : parse_image_name(image_of(table, row, frames));
}

// Returns where the image of a row is, if one of `roots` has it: the average of a movie, or else
// what the row names.
std::optional<ImageInFile> find_image(const ViewTable& table, std::size_t row, Frames frames,
                                      std::span<const fs::path> roots) {
  const ImageInFile named = named_by(table, row, frames);
  std::optional<fs::path> found;
  if (table.names_movies) found = look_for(average_of(named.file, frames), roots);
  const bool may_be_image =
      !table.names_movies || (frames == Frames::kAll && named.file.extension() == ".mrc");
  if (!found && may_be_image) found = look_for(named.file, roots);
  return found ? std::optional(ImageInFile{*found, named.section}) : std::nullopt;
}

// Returns the folder in which the names of the table begin: the first that has one of its images.
// All of the folders if none has.
std::vector<fs::path> root_of(const ViewTable& table, Frames frames) {
  std::vector<fs::path> roots = roots_of(table.file);
  for (const fs::path& root : roots) {
    for (std::size_t row = 0; row < table.views.size(); ++row) {
      const bool is_relative = named_by(table, row, frames).file.is_relative();
      if (is_relative && find_image(table, row, frames, {&root, 1})) return {root};
    }
  }
  return roots;
}

// Says that the image of a row is in none of the folders where it may be.
[[noreturn]] void throw_missing(const ViewTable& table, std::size_t row, Frames frames,
                                const std::vector<fs::path>& roots) {
  const fs::path named = named_by(table, row, frames).file;
  const std::string what = table.names_movies
                               ? fmt::format("the aligned average '{}' of '{}'",
                                             average_of(named, frames).string(), named.string())
                               : fmt::format("the image '{}'", named.string());
  const std::string where =
      roots.size() == 1
          ? fmt::format("is not in '{}', where other names of the table begin",
                        roots.front().empty() ? "." : roots.front().string())
          : "was found neither in the folder of the table or above it nor in the current folder";
  const std::string warp =
      table.names_movies ? fmt::format("run Warp's fs_motion_and_ctf with --out_averages{}, or ",
                                       frames == Frames::kAll ? "" : " --out_average_halves")
                         : "";
  const char* const advice = roots.size() == 1
                                 ? "put it there, or take its row out of the table"
                                 : "start the command in the folder in which the names begin";
  throw Error(fmt::format("'{}', row {}: {} {}: {}{}", table.file.string(), row + 1, what, where,
                          warp, advice));
}

// Refuses a table with absolute names of which some files are there, and others elsewhere: the old
// place of a project that was moved has some left.
void require_one_place(const ViewTable& table, const std::vector<ImageInFile>& places,
                       Frames frames) {
  std::optional<std::size_t> as_named, moved;
  for (std::size_t row = 0; row < places.size(); ++row) {
    const fs::path file = named_by(table, row, frames).file;
    const fs::path named = table.names_movies ? average_of(file, frames) : file;
    if (!named.is_absolute()) continue;
    (places[row].file == named.lexically_normal() ? as_named : moved) = row;
  }
  if (!as_named || !moved) return;
  throw Error(fmt::format(
      "'{}': the image of row {} is '{}', as the table names it, and that of row {} is not at its "
      "name, but may be '{}': a series is of one place, so move the old folder away or correct the "
      "names",
      table.file.string(), *as_named + 1, places[*as_named].file.string(), *moved + 1,
      places[*moved].file.string()));
}

// Refuses tables and lists as images: a table that names itself would never end.
void require_images(const ViewTable& table, Frames frames) {
  for (std::size_t row = 0; !table.names_movies && row < table.views.size(); ++row) {
    const fs::path file = parse_image_name(image_of(table, row, frames)).file;
    if (is_view_table(file) || file.extension() == ".mdoc")
      throw Error(fmt::format("'{}', row {}: '{}' is no file of images", table.file.string(),
                              row + 1, file.string()));
  }
}

}  // namespace

ImageInFile parse_image_name(std::string_view name) {
  // RELION states the format of files with other extensions: "000001@TS_01.st:mrc".
  for (const std::string_view format : {":mrcs", ":mrc"})
    if (name.ends_with(format)) name.remove_suffix(format.size());
  const std::size_t at = name.find('@');
  if (at == std::string_view::npos) return {fs::path(name), std::nullopt};
  const auto number = parse_integer(name.substr(0, at));
  if (!number || *number < 1) {
    throw Error(fmt::format(
        "the image '{}' is not named as 000001@stack.mrc: sections count from 1", quote(name)));
  }
  return {fs::path(name.substr(at + 1)), *number - 1};
}

fs::path find_listed_file(const fs::path& name, const fs::path& list) {
  if (const auto found = look_for(name, roots_of(list))) return *found;
  throw Error(
      fmt::format("'{}' names '{}', which was found neither in the folder of the list or above it "
                  "nor in the current folder: start the command in the project's folder",
                  list.string(), name.string()));
}

fs::path root_of_listed_file(const fs::path& name, const fs::path& list) {
  if (name.is_absolute()) return {};
  const std::vector<fs::path> roots = roots_of(list);
  const auto has_file = [&](const fs::path& root) { return is_file(root / name); };
  const auto root = std::ranges::find_if(roots, has_file);
  return root == roots.end() ? fs::path() : *root;
}

std::vector<ImageInFile> find_view_images(const ViewTable& table, Frames frames) {
  require_images(table, frames);
  const std::vector<fs::path> roots = root_of(table, frames);
  std::vector<ImageInFile> places;
  for (std::size_t row = 0; row < table.views.size(); ++row) {
    const auto place = find_image(table, row, frames, roots);
    if (!place) throw_missing(table, row, frames, roots);
    places.push_back(*place);
  }
  require_one_place(table, places, frames);
  return places;
}

std::shared_ptr<const ImageStack> open_view_images(const fs::path& table) {
  const std::string name = table.string();
  const Frames frames = name.starts_with("even@")  ? Frames::kEven
                        : name.starts_with("odd@") ? Frames::kOdd
                                                   : Frames::kAll;
  return image_stack_of_files(find_view_images(read_view_table(table), frames), name);
}

}  // namespace tomofield::io
