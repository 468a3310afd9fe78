#pragma once

#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "io/images/image_stack.h"
#include "io/tables/view_table.h"

namespace tomofield::io {

/// Parses the name of an image as RELION writes it: "dir/a.mrc", or "000002@stack.mrc" for the
/// second section of a stack. Throws Error for a number that counts no section.
ImageInFile parse_image_name(std::string_view name);

/// Returns the file that `list` names. A relative name is looked for in the folder of `list` and in
/// those above it, of which one is the project's, then in the current folder, which may be that of
/// another project. Throws Error if it is in none of them.
std::filesystem::path find_listed_file(const std::filesystem::path& name,
                                       const std::filesystem::path& list);

/// Returns the folder in which the name of a file that `list` names begins, as find_listed_file()
/// finds it: empty for the current folder, and for an absolute name.
std::filesystem::path root_of_listed_file(const std::filesystem::path& name,
                                          const std::filesystem::path& list);

/// The images of a view: those of all its frames, or of half of them.
enum class Frames { kAll, kEven, kOdd };

/// Returns where the images of all views are. Relative names begin in one folder, the first of
/// those of find_listed_file() that has an image, so that no series is made of two projects. Warp's
/// tables name movies: then it is the aligned averages that Warp keeps in the folder "average"
/// beside them. Throws Error with the row for an image that cannot be found.
std::vector<ImageInFile> find_view_images(const ViewTable& table, Frames frames = Frames::kAll);

/// Opens the images of a table of views as one stack. "even@TABLE" and "odd@TABLE" are those of
/// half of the frames.
std::shared_ptr<const ImageStack> open_view_images(const std::filesystem::path& table);

}  // namespace tomofield::io
