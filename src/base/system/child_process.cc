#include "base/system/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cstdlib>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <string_view>
#include <thread>
#include <utility>

#include "tomofield/error.h"

namespace tomofield::base {
namespace {

bool has_limit_of_time() {
  rlimit limit{};
  return getrlimit(RLIMIT_CPU, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
}

double seconds(const timeval& t) {
  return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

// Becomes the program, in the new process. Returns errno if that is not possible. The parent may
// have other threads, so that only system calls are allowed here.
int become(char* const* arguments, const char* log, pid_t parent) {
  // If the parent is killed, its child is asked to stop. It may have been killed just before.
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  const int output = open(log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (output < 0 || dup2(output, STDOUT_FILENO) < 0 || dup2(output, STDERR_FILENO) < 0)
    return errno;
  execv(arguments[0], arguments);
  return errno;
}

pid_t start(const std::vector<std::string>& command, const std::filesystem::path& log) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  std::array<int, 2> faults{};  // a pipe that closes when the program has started
  int fault = pipe2(faults.data(), O_CLOEXEC) == 0 ? 0 : errno;
  const pid_t parent = getpid();
  const pid_t child = fault == 0 ? fork() : -1;
  if (child == 0) {
    fault = become(arguments.data(), log.c_str(), parent);
    (void)!write(faults[1], &fault, sizeof fault);
    _exit(127);
  }
  if (fault == 0) {
    if (child < 0) fault = errno;
    close(faults[1]);
    while (child > 0 && read(faults[0], &fault, sizeof fault) < 0 && errno == EINTR) {
    }
    close(faults[0]);
  }
  if (fault != 0) {
    if (child > 0) waitpid(child, nullptr, 0);
    throw Error(fmt::format("'{}' cannot be run with its output in '{}': {}", command[0],
                            log.string(), std::strerror(fault)));
  }
  return child;
}

}  // namespace

Costs operator+(const Costs& one, const Costs& other) {
  return {one.core_seconds + other.core_seconds, one.wall_seconds + other.wall_seconds,
          std::max(one.peak_bytes, other.peak_bytes)};
}

ChildProcess::ChildProcess(const std::vector<std::string>& command,
                           const std::filesystem::path& log)
    : program_(command[0]), child_(start(command, log)) {}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : program_(std::move(other.program_)),
      child_(std::exchange(other.child_, -1)),
      is_told_(other.is_told_),
      running_(other.running_) {}

ChildProcess::~ChildProcess() {
  if (child_ < 0) return;
  ask_to_stop();
  while (waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<ChildResult> ChildProcess::poll() {
  int status = 0;
  rusage usage{};
  const pid_t ended = wait4(child_, &status, WNOHANG, &usage);
  if (ended == 0 || (ended < 0 && errno == EINTR)) return std::nullopt;
  if (ended < 0) {
    child_ = -1;
    throw Error(fmt::format("'{}' was lost: {}", program_, std::strerror(errno)));
  }
  child_ = -1;
  return ChildResult{
      .exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
      .costs = {.core_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime),
                .wall_seconds = running_.seconds(),
                .peak_bytes = std::int64_t{usage.ru_maxrss} * 1024}};
}

void ChildProcess::ask_to_stop() {
  if (!is_told_ && child_ > 0) kill(child_, SIGTERM);
  is_told_ = true;
}

void pause_between_polls() { std::this_thread::sleep_for(std::chrono::milliseconds(20)); }

ChildResult run_child(const std::vector<std::string>& command, const std::filesystem::path& log,
                      const std::function<bool()>& stop_requested) {
  ChildProcess child(command, log);
  for (;;) {
    if (const auto result = child.poll()) return *result;
    if (stop_requested && stop_requested()) child.ask_to_stop();
    pause_between_polls();
  }
}

std::string reason_of_failure(int exit_status, const std::filesystem::path& log) {
  constexpr int kSignal = 128;
  if (exit_status == kSignal + SIGKILL)
    return fmt::format("it was killed, as the system does when memory runs out{}",
                       has_limit_of_time() ? " or the processor time of ulimit -t is used up" : "");
  const std::string said = reason_of_failure(log);
  if (exit_status > kSignal)
    return fmt::format("signal {} ended it{}", exit_status - kSignal,
                       said.empty() ? ", and it said nothing" : "; it said last: " + said);
  if (!said.empty()) return said;
  std::error_code error;
  const auto space = std::filesystem::space(log.parent_path(), error);
  constexpr std::uintmax_t kRoomOfSentence = 1 << 14;
  if (!error && space.available < kRoomOfSentence)
    return fmt::format(
        "it failed with status {}, and '{}' has no space left for what it said: free "
        "some there",
        exit_status, log.parent_path().string());
  return fmt::format("it failed with status {}", exit_status);
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

std::filesystem::path program_path() {
  if (const char* launcher = std::getenv("TOMOFIELD_LAUNCHER")) return launcher;
  return std::filesystem::read_symlink("/proc/self/exe");
}

}  // namespace tomofield::base
