#include "projects/project.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "base/check.h"
#include "io/saving/output_files.h"
#include "io/tables/text_lines.h"
#include "option_table/values.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// This entry is not of a project's main file: the plan of a series asks for it.
constexpr std::string_view kTiltAxis = "TiltAxisAngle";

struct MainFile {
  const Format* format = nullptr;
  fs::path path;
};

// Tells whether a file has the word of its format, in UTF-8 or UTF-16. One that cannot be read may:
// the error says so when it is read.
bool has_word(const fs::path& path, std::string_view word) {
  if (word.empty()) return true;
  try {
    std::string text = io::read_small_file(path);
    std::erase(text, '\0');
    return text.find(word) != std::string::npos;
  } catch (const Error&) {
    return true;
  }
}

// Returns the main files of a folder of formats of a rank, sorted by name.
std::vector<MainFile> main_files(const fs::path& folder, int rank) {
  std::vector<MainFile> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    std::error_code absent;
    if (!entry.is_regular_file(absent)) continue;
    const std::string name = entry.path().filename().string();
    for (const Format& format : all_formats()) {
      if (format.rank == rank && format.is_main_file(name) && has_word(entry.path(), format.word))
        found.push_back({&format, entry.path()});
    }
  }
  std::ranges::sort(found, {}, &MainFile::path);
  return found;
}

std::string names_of_formats() {
  std::vector<std::string_view> names;
  for (const Format& format : all_formats()) names.push_back(format.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

// Returns the one main file of a folder, or none if the folder may be one of images. Throws Error
// if there is none, or more than one.
MainFile find_main_file(const fs::path& folder, bool may_have_images) {
  std::vector<MainFile> found = main_files(folder, 0);
  if (found.empty() && may_have_images) return {};
  const int last_rank = std::ranges::max(all_formats(), {}, &Format::rank).rank;
  for (int rank = 1; found.empty() && rank <= last_rank; ++rank) found = main_files(folder, rank);
  if (found.empty()) {
    throw Error(fmt::format("the folder '{}' has no project that can be read ({}): name a file",
                            folder.string(), names_of_formats()));
  }
  if (found.size() == 1) return found.front();
  constexpr std::size_t kMostNames = 6;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(found.size(), kMostNames); ++i)
    names.push_back(found[i].path.filename().string());
  if (found.size() > kMostNames) names.emplace_back("…");
  throw Error(fmt::format("the folder '{}' has {} projects, {}: name one of these files",
                          folder.string(), found.size(), fmt::join(names, ", ")));
}

// Returns the format of a file by the end of its name, or null.
const Format* format_of(const fs::path& path) {
  const std::string extension = path.extension().string();
  const auto formats = all_formats();
  const auto it = std::ranges::find_if(formats, [&](const Format& format) {
    return option_table::has_name({extension}, format.extension);
  });
  return it == formats.end() ? nullptr : &*it;
}

// Throws Error if entries are to be ignored of what has none, a stack or a folder of images.
std::nullopt_t no_project(const Request& request) {
  for (const std::string& entry : request.ignored)
    if (!option_table::has_name({entry}, kTiltAxis))
      throw Error(
          fmt::format("--ignore {}: '{}' is no project, and has no such entry: leave it out", entry,
                      request.path.string()));
  return std::nullopt;
}

}  // namespace

bool Project::ignores(std::string_view entry) {
  met_.emplace_back(entry);
  return option_table::has_name(request_.ignored, entry);
}

std::string Project::value_of(std::string_view option) const {
  const auto found = std::ranges::find(settings_, option, &Setting::option);
  return found == settings_.end() ? std::string() : found->value;
}

void Project::set(std::string_view option, std::string value, const fs::path& file,
                  std::string_view entry, std::string row) {
  if (ignores(entry)) return;
  const bool is_new = std::ranges::find(settings_, option, &Setting::option) == settings_.end();
  TOMOFIELD_CHECK(is_new, fmt::format("{} is set twice", option));
  settings_.push_back(
      {std::string(option), std::move(value), file, std::string(entry), std::move(row)});
}

void Project::require_no_stray_ignored() const {
  for (const std::string& entry : request_.ignored) {
    if (option_table::has_name(met_, entry) || option_table::has_name({entry}, kTiltAxis)) continue;
    throw Error(
        fmt::format("--ignore {}: no file of '{}' has this entry: leave it out, or write "
                    "it as the file does",
                    entry, request_.path.string()));
  }
}

void require_no_series(const Request& request) {
  if (request.series.empty()) return;
  throw Error(fmt::format("'{}' is one series, so leave --series {} out", request.path.string(),
                          request.series));
}

std::optional<Project> read_project(const Request& request) {
  std::error_code absent;
  MainFile main{format_of(request.path), request.path};
  if (fs::is_directory(request.path, absent))
    main = find_main_file(request.path, request.has_mdoc);
  else if (!fs::exists(request.path, absent))
    return no_project(request);
  if (main.format == nullptr || !main.format->has_several) require_no_series(request);
  if (main.format == nullptr) return no_project(request);
  Request of_file = request;
  of_file.path = main.path;
  Project project(of_file);
  project.add_file(main.path);
  main.format->read(project);
  project.require_no_stray_ignored();
  for (const fs::path& file : project.files()) io::add_input(file);
  return project;
}

}  // namespace tomofield::projects
