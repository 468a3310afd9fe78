#include "compare/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <string_view>
#include <thread>

#include "base/stopwatch.h"
#include "tomofield/error.h"

extern char** environ;

namespace tomofield::compare {
namespace {

double seconds(const timeval& t) {
  return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

pid_t start(const std::vector<std::string>& command, const std::filesystem::path& log) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t child = 0;
  const int fault = posix_spawn(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (fault != 0) {
    throw Error(fmt::format("'{}' cannot be run with its output in '{}': {}", command[0],
                            log.string(), std::strerror(fault)));
  }
  return child;
}

}  // namespace

ChildResult run_child(const std::vector<std::string>& command, const std::filesystem::path& log,
                      const std::function<bool()>& stop_requested) {
  constexpr auto kPause = std::chrono::milliseconds(20);
  const base::Stopwatch running;
  const pid_t child = start(command, log);
  bool told = false;
  int status = 0;
  rusage usage{};
  for (;;) {
    const pid_t ended = wait4(child, &status, WNOHANG, &usage);
    if (ended == child) break;
    if (ended < 0 && errno != EINTR)
      throw Error(fmt::format("'{}' was lost: {}", command[0], std::strerror(errno)));
    if (!told && stop_requested && stop_requested()) {
      kill(child, SIGTERM);
      told = true;
    }
    std::this_thread::sleep_for(kPause);
  }
  return {.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
          .core_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime),
          .wall_seconds = running.seconds(),
          .peak_bytes = std::int64_t{usage.ru_maxrss} * 1024};
}

std::string reason_of_failure(const std::filesystem::path& log) {
  constexpr std::string_view kSpeaker = "tomofield: ";
  std::ifstream file(log);
  std::string last, sentence;  // earlier output may come after it in the file
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(kSpeaker)) sentence = line.substr(kSpeaker.size());
    if (!line.empty()) last = line;
  }
  return sentence.empty() ? last : sentence;
}

}  // namespace tomofield::compare
