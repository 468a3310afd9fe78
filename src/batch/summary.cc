#include "batch/summary.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "base/log.h"
#include "base/progress.h"
#include "batch/choice.h"
#include "batch/csv.h"
#include "batch/relion_table.h"
#include "batch/state_record.h"
#include "io/file_start.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "output/output_paths.h"
#include "record/run_summary_record.h"
#include "report/html.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

constexpr double kGibibyte = 1 << 30;

// Holds what the summary says of one series.
struct Line {
  const Job* job;
  State state;
  record::RunSummary run;
};

// Reads what a finished run says of itself. A file that cannot be read says nothing.
record::RunSummary read_run(const fs::path& file) {
  try {
    return record::read_summary(file);
  } catch (const Error&) {
    return {};
  }
}

bool has_result(const Line& line) {
  const Progress progress = line.state.progress;
  return progress == Progress::kDone || progress == Progress::kSkipped;
}

std::vector<Job> finished_jobs(const std::vector<Line>& lines) {
  std::vector<Job> finished;
  for (const Line& line : lines)
    if (has_result(line)) finished.push_back(*line.job);
  return finished;
}

std::vector<Line> read_lines(const fs::path& folder, const std::vector<Job>& jobs) {
  std::vector<Line> lines;
  for (const Job& job : jobs) {
    lines.push_back({&job, read_state(folder, job), {}});
    if (has_result(lines.back()))
      lines.back().run = read_run(output::output_paths(job.output).json);
  }
  return lines;
}

std::string number(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string optional_number(const std::optional<double>& value, int digits) {
  return value ? number(*value, digits) : std::string();
}

// Returns the line of a verdict without the word that begins it.
std::string verdict_text(const std::string& line) {
  constexpr std::string_view kTitle = "verdict: ";
  return line.starts_with(kTitle) ? line.substr(kTitle.size()) : line;
}

constexpr std::string_view kColumns =
    "name,state,reason,output,wall_seconds,core_seconds,expected_core_seconds,peak_GiB,"
    "expected_GiB,held_out_error,verdict,warnings\n";

std::string csv_text(const std::vector<Line>& lines) {
  std::string text(kColumns);
  for (const Line& line : lines) {
    const base::Costs& costs = line.state.costs;
    const Needs& needs = line.job->needs;
    const std::array fields{
        spreadsheet_text(line.job->name),
        std::string(base::name_of(line.state.progress)),
        spreadsheet_text(line.state.reason),
        spreadsheet_text(line.job->output.string()),
        number(costs.wall_seconds, 1),
        number(costs.core_seconds, 1),
        optional_number(needs.core_seconds, 1),
        number(static_cast<double>(costs.peak_bytes) / kGibibyte, 3),
        number(static_cast<double>(needs.memory_bytes_of_one_thread) / kGibibyte, 3),
        optional_number(line.run.held_out_error, 5),
        spreadsheet_text(verdict_text(line.run.verdict)),
        spreadsheet_text(fmt::format("{}", fmt::join(line.run.warnings, " "))),
    };
    std::vector<std::string> quoted;
    for (const std::string& field : fields) quoted.push_back(csv_field(field));
    text += fmt::format("{}\n", fmt::join(quoted, ","));
  }
  return text;
}

// Returns the links to the files of a series that are there.
std::vector<report::HtmlLink> links_of(const fs::path& folder, const Job& job) {
  const output::OutputPaths paths = output::output_paths(job.output);
  std::vector<report::HtmlLink> links;
  const auto add = [&](const char* text, const fs::path& file) {
    if (fs::exists(file)) links.push_back({text, fs::absolute(file).lexically_proximate(folder)});
  };
  add("report", paths.report);
  add("tomogram", paths.volume);
  add("metrics", paths.json);
  add("log", log_of(folder, job));
  return links;
}

// Returns the words about a series: its verdict and warnings, or why it has none.
std::string words_of(const Line& line) {
  std::vector<std::string> words;
  for (const std::string& text : {line.state.reason, line.run.verdict})
    if (!text.empty()) words.push_back(text);
  for (const std::string& warning : line.run.warnings) words.push_back("Warning: " + warning);
  return fmt::format("{}", fmt::join(words, "\n"));
}

std::string mark_of(const Line& line) {
  if (line.state.progress == Progress::kFailed) return "bad";
  return line.run.warnings.empty() ? "" : "warned";
}

std::vector<report::HtmlCell> page_row(const fs::path& folder, const Line& line) {
  const base::Costs& costs = line.state.costs;
  const fs::path picture = output::output_paths(line.job->output).slice_pictures[0];
  report::HtmlCell shown{.text = {}, .mark = "picture"};
  if (fs::exists(picture)) shown.picture = fs::absolute(picture).lexically_proximate(folder);
  const bool has_run = costs.wall_seconds > 0;
  return {{.text = line.job->name, .mark = {}},
          shown,
          {.text = base::name_of(line.state.progress), .mark = mark_of(line)},
          {.text = words_of(line), .mark = "words"},
          {.text = has_run ? base::time_text(costs.wall_seconds) : "", .mark = {}},
          {.text = has_run ? base::time_text(costs.core_seconds) : "", .mark = {}},
          {.text = has_run ? number(static_cast<double>(costs.peak_bytes) / kGibibyte, 2) : "",
           .mark = {}},
          {.text = optional_number(line.run.held_out_error, 3), .mark = {}},
          {.text = {}, .mark = {}, .links = links_of(folder, *line.job)}};
}

// Returns how many series have each state: "3 done, 1 failed".
std::string counts_text(const std::vector<Line>& lines) {
  std::map<Progress, int> counts;
  for (const Line& line : lines) ++counts[line.state.progress];
  std::vector<std::string> parts;
  for (const auto& [progress, count] : counts)
    parts.push_back(fmt::format("{} {}", count, base::name_of(progress)));
  return fmt::format("{}", fmt::join(parts, ", "));
}

// Returns what the page says of the choice for all series, or an empty text if there is none. Says
// why a choice cannot be read, which only matters to a batch that goes on.
std::string choice_text(const fs::path& folder) {
  try {
    const std::optional<Choice> choice = read_choice(folder);
    if (!choice) return {};
    return fmt::format(
        "Total variation of all series that do not state their own: {}. With --choose each, every "
        "series chooses for itself.",
        describe(*choice));
  } catch (const Error& error) {
    return error.what();
  }
}

std::string page_text(const fs::path& folder, const std::vector<Line>& lines) {
  report::HtmlPage page("Batch: " + folder.filename().string());
  page.add_paragraph(
      fmt::format("tomofield {}; {} series: {}. Times and memory are those of all "
                  "sessions of a series.",
                  TOMOFIELD_VERSION, lines.size(), counts_text(lines)));
  if (const std::string choice = choice_text(folder); !choice.empty()) page.add_paragraph(choice);
  std::vector<std::vector<report::HtmlCell>> rows(1);
  for (const char* title : {"series", "", "state", "verdict", "time", "processor time",
                            "memory, GiB", "held-out error", "files"})
    rows.front().push_back({.text = title, .mark = title == std::string("verdict") ? "words" : ""});
  for (const Line& line : lines) rows.push_back(page_row(folder, line));
  page.add_table(rows);
  return page.document();
}

// Locks a file that other processes never lock for long.
io::OutputLock wait_for_lock(const fs::path& file) {
  constexpr int kTries = 200;
  constexpr auto kPause = std::chrono::milliseconds(50);
  for (int i = 1; i < kTries; ++i) {
    try {
      return io::OutputLock(file);
    } catch (const Error&) {
      std::this_thread::sleep_for(kPause);
    }
  }
  return io::OutputLock(file);
}

}  // namespace

bool has_summary(const fs::path& folder) {
  return io::begins_with(summary_table(folder), kColumns);
}

fs::path summary_table(const fs::path& folder) { return folder / "summary.csv"; }
fs::path summary_page(const fs::path& folder) { return folder / "index.html"; }

void write_summary(const fs::path& folder, const std::vector<Job>& jobs) {
  try {
    const io::OutputLock lock = wait_for_lock(summary_table(folder));  // before states are read
    const std::vector<Line> lines = read_lines(folder, jobs);
    io::OutputSet files;
    io::write_text_file(summary_table(folder), csv_text(lines));
    io::write_text_file(summary_page(folder), page_text(fs::absolute(folder), lines));
    write_relion_table(folder, jobs, finished_jobs(lines));
    files.commit();
  } catch (const Error& error) {
    base::log_warning(fmt::format("the summary is old: {}", error.what()));
  }
}

}  // namespace tomofield::batch
