#include "cli/progress_bar.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

namespace tomofield::cli {
namespace {

constexpr double kSecondsBetweenLines = 5.0;
constexpr double kSecondsBetweenDraws = 0.2;
constexpr int kBarWidth = 24;

std::string bar(double fraction) {
  const int full = static_cast<int>(std::lround(std::clamp(fraction, 0.0, 1.0) * kBarWidth));
  return std::string(static_cast<std::size_t>(full), '#') +
         std::string(static_cast<std::size_t>(kBarWidth - full), '.');
}

}  // namespace

std::string format_duration(double seconds) {
  const long s = std::lround(std::max(0.0, seconds));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

base::ProgressSink make_progress_bar(const std::string& title) {
  const bool terminal = isatty(STDERR_FILENO) == 1;
  auto last = std::make_shared<double>(-1e9);
  return [=](const base::ProgressReport& report) {
    const bool finished = report.fraction_done >= 1.0;
    if (!finished &&
        report.seconds_elapsed - *last < (terminal ? kSecondsBetweenDraws : kSecondsBetweenLines))
      return;
    *last = report.seconds_elapsed;
    const std::string state = fmt::format("{:3.0f} %  {}  {} left", 100 * report.fraction_done,
                                          report.detail, format_duration(report.seconds_left));
    if (terminal) {
      fmt::print(stderr, "\r\033[K{} [{}] {}{}", title, bar(report.fraction_done), state,
                 finished ? "\n" : "");
    } else {
      fmt::print(stderr, "{} {}\n", title, state);
    }
    std::fflush(stderr);
  };
}

}  // namespace tomofield::cli
