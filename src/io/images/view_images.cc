#include "io/images/view_images.h"

#include <fmt/format.h>

#include <optional>
#include <system_error>

#include "io/is_file.h"
#include "io/named_file.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

// Looks for a file in the current folder, and in that of `list` and those above it.
std::optional<fs::path> look_for(const fs::path& name, const fs::path& list) {
  if (is_file(name)) return name;
  std::vector<fs::path> folders;
  std::error_code failed;
  fs::path folder = fs::absolute(list, failed).parent_path();
  while (!failed) {
    folders.push_back(folder);
    if (folder == folder.parent_path()) break;
    folder = folder.parent_path();
  }
  const auto found = find_named_file(name.string(), folders);
  return found ? std::optional(found->lexically_normal()) : std::nullopt;
}

// Looks for an image of Warp, whose names begin in the folder of the table, before that elsewhere.
std::optional<fs::path> look_for_of_warp(const fs::path& name, const fs::path& list) {
  const fs::path beside = (list.parent_path() / name).lexically_normal();
  return is_file(beside) ? std::optional(beside) : look_for(name, list);
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

ImageInFile place_of_movie(const ViewTable& table, std::size_t row, Frames frames) {
  const fs::path movie = table.views[row].image;
  const fs::path average = average_of(movie, frames);
  if (const auto found = look_for_of_warp(average, table.file)) return {*found, std::nullopt};
  const bool may_be_image = frames == Frames::kAll && movie.extension() == ".mrc";
  if (may_be_image) {
    if (const auto found = look_for_of_warp(movie, table.file)) return {*found, std::nullopt};
  }
  throw Error(fmt::format(
      "'{}', row {}: the aligned average '{}' of '{}' was found neither from the current folder "
      "nor "
      "from that of the table: run Warp's fs_motion_and_ctf with --out_averages{}, or start the "
      "command in the folder that the names begin from",
      table.file.string(), row + 1, average.string(), movie.string(),
      frames == Frames::kAll ? "" : " --out_average_halves"));
}

ImageInFile place_of_image(const ViewTable& table, std::size_t row, Frames frames) {
  ImageInFile place = parse_image_name(image_of(table, row, frames));
  if (is_view_table(place.file) || place.file.extension() == ".mdoc") {
    throw Error(fmt::format("'{}', row {}: '{}' is no file of images", table.file.string(), row + 1,
                            place.file.string()));
  }
  place.file = find_listed_file(place.file, table.file);
  return place;
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
  if (const auto found = look_for(name, list)) return *found;
  throw Error(
      fmt::format("'{}' names '{}', which was found neither in the current folder nor in "
                  "that of the list or above it: start the command in the project's folder",
                  list.string(), name.string()));
}

std::vector<ImageInFile> find_view_images(const ViewTable& table, Frames frames) {
  std::vector<ImageInFile> places;
  for (std::size_t row = 0; row < table.views.size(); ++row)
    places.push_back(table.names_movies ? place_of_movie(table, row, frames)
                                        : place_of_image(table, row, frames));
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
