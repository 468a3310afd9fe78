#include "cli/terminal/progress_bar.h"
#include "base/progress.h"
#include "cli/terminal/console.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>

namespace tomofield::cli {
namespace {

constexpr double kSecondsBetweenLines = 5.0;
constexpr double kSecondsBetweenDraws = 0.2;
constexpr std::size_t kBarWidth = 24;
constexpr std::size_t kMinBarWidth = 8;

// Returns the columns of the terminal. A longer line would wrap and could not be redrawn.
std::size_t terminal_width() {
  winsize size{};
  const bool is_known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return is_known ? size.ws_col : 80;
}

std::string bar(double fraction, std::size_t width) {
  const double full = std::clamp(fraction, 0.0, 1.0) * static_cast<double>(width);
  const auto marks = static_cast<std::size_t>(std::lround(full));
  return std::string(marks, '#') + std::string(width - marks, '.');
}

std::string terminal_line(const std::string& title, double fraction, const std::string& state) {
  const std::size_t columns = terminal_width() - 1;
  const std::size_t others = title.size() + state.size() + std::string_view(" [] ").size();
  const std::size_t room = columns > others ? columns - others : 0;
  std::string line =
      room < kMinBarWidth
          ? title + " " + state
          : fmt::format("{} [{}] {}", title, bar(fraction, std::min(room, kBarWidth)), state);
  line.resize(std::min(line.size(), columns));
  return line;
}

// The time of the last report, whether it said that everything is done, and whether the cursor is
// still behind it on a terminal. If so, the destructor ends the line, so that later output of a run
// that stopped or failed begins on its own. Trials that nobody expected come after the end.
struct Display {
  double last_shown = -1e9;
  bool was_whole = false;
  bool line_is_open = false;
  Display() = default;
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;
  ~Display() {
    if (line_is_open) say("\n");
  }
};

}  // namespace

base::ProgressSink make_progress_bar(const std::string& title) {
  const bool terminal = isatty(STDERR_FILENO) == 1;
  auto display = std::make_shared<Display>();
  return [=](const base::ProgressReport& report) {
    base::allow_interruption();
    const bool is_whole = report.fraction_done >= 1.0;
    const bool has_just_ended = is_whole && !display->was_whole;
    const double pause = terminal ? kSecondsBetweenDraws : kSecondsBetweenLines;
    if (!has_just_ended && report.seconds_elapsed - display->last_shown < pause) return;
    display->last_shown = report.seconds_elapsed;
    display->was_whole = is_whole;
    const std::string state = fmt::format("{:3.0f} %  {}  {} left", 100 * report.fraction_done,
                                          report.detail, base::time_text(report.seconds_left));
    if (terminal) {
      say("\r\033[K{}", terminal_line(title, report.fraction_done, state));
      if (has_just_ended) say("\n");
      display->line_is_open = !has_just_ended;
    } else {
      say("{} {}\n", title, state);
    }
  };
}

}  // namespace tomofield::cli
