#include "batch/file_conflicts.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <string>
#include <system_error>

#include "batch/own_files.h"
#include "io/saving/file_identity.h"
#include "io/saving/output_files.h"
#include "output/output_paths.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> results_of(const Job& job) {
  if (!job.is_skipped) return job.files.results;
  const output::OutputPaths paths = output::output_paths(job.output);
  std::vector<fs::path> files{paths.volume, paths.model, paths.json, paths.report};
  for (const fs::path& picture : paths.pictures()) files.push_back(picture);
  return files;
}

void require_no_folders(const std::vector<fs::path>& files, base::Faults& faults) {
  std::error_code absent;
  for (const fs::path& file : files)
    if (fs::is_directory(file, absent))
      faults.add(fmt::format(
          "'{}' is a folder, and the batch writes a file of this name: move it, or give another "
          "folder with --output",
          file.string()));
}

// Collects who writes which files, and finds those that are written twice or read.
class Writers {
 public:
  explicit Writers(base::Faults& faults) : faults_(faults) {}

  void add(const std::string& writer, const std::vector<fs::path>& files) {
    for (const fs::path& file : files) {
      const auto [first, is_new] = writers_.emplace(io::identity_of(file), Written{writer, file});
      if (is_new || first->second.writer == writer) continue;
      faults_.add(fmt::format("{} and {} would both write '{}'{}: give one another name or output",
                              first->second.writer, writer, file.string(),
                              other_spelling(first->second.file, file)));
      return;  // one sentence for two writers
    }
  }

  // A name cannot be a file and a folder with another file in it.
  void require_no_folders() {
    std::set<fs::path> seen;
    for (const auto& [identity, inner] : writers_) {
      for (fs::path folder = fs::absolute(inner.file).lexically_normal().parent_path();
           seen.insert(folder).second; folder = folder.parent_path()) {
        const auto found = writers_.find(io::identity_of(folder));
        if (found == writers_.end()) continue;
        faults_.add(fmt::format(
            "{} would write '{}', and {} needs a folder of this name: give one another name or "
            "output",
            found->second.writer, found->second.file.string(), inner.writer));
      }
    }
  }

  void require_none_reads(const std::string& reader, const std::vector<fs::path>& files) {
    for (const fs::path& file : files) {
      const auto found = writers_.find(io::identity_of(file));
      if (found == writers_.end()) continue;
      faults_.add(fmt::format(
          "{} would replace '{}'{}, which {} is read from: give it another name or output",
          found->second.writer, found->second.file.string(),
          other_spelling(file, found->second.file), reader));
    }
  }

 private:
  struct Written {
    std::string writer;
    fs::path file;
  };

  static std::string other_spelling(const fs::path& file, const fs::path& named) {
    return file == named ? "" : fmt::format(", which is '{}'", file.string());
  }

  base::Faults& faults_;
  std::map<io::FileIdentity, Written> writers_;
};

}  // namespace

void check_files(const fs::path& folder, const fs::path& list, const std::vector<Job>& jobs,
                 base::Faults& faults) {
  Writers writers(faults);
  const auto name_of = [](const Job& job) { return fmt::format("the series '{}'", job.name); };
  const std::vector<fs::path> own = files_of_batch(folder, jobs);
  require_no_folders(own, faults);
  writers.add("the batch itself", own);
  for (const Job& job : jobs) writers.add(name_of(job), results_of(job));
  writers.require_no_folders();
  writers.require_none_reads("the list of the series", {list});
  writers.require_none_reads("the command line", io::added_inputs());
  for (const Job& job : jobs) writers.require_none_reads(name_of(job), job.files.inputs);
}

}  // namespace tomofield::batch
