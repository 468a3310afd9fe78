#include "view/http/worker.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>
#include <utility>

#include "tomofield/error.h"

namespace tomofield::view {
namespace {

int new_event() {
  const int event = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (event < 0) throw Error("the system gives no more file descriptors to the server");
  return event;
}

}  // namespace

Response refusal(int status, const std::string& reason) {
  return {.status = status, .body = reason + "\n", .more_headers = {}};
}

Worker::Worker() : done_fd_(new_event()), thread_([this] { run(); }) {}

Worker::~Worker() {
  must_stop_ = true;
  {
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
  }
  has_changed_.notify_one();
  thread_.join();
  ::close(done_fd_);
}

void Worker::start(Work work) {
  {
    const std::lock_guard lock(mutex_);
    work_ = std::move(work);
    must_stop_ = false;
  }
  has_changed_.notify_one();
}

std::optional<Response> Worker::take_answer() {
  const std::lock_guard lock(mutex_);
  if (!answer_) return std::nullopt;
  std::uint64_t count;
  [[maybe_unused]] const ssize_t size = ::read(done_fd_, &count, sizeof count);
  return std::exchange(answer_, std::nullopt);
}

void Worker::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    has_changed_.wait(lock, [&] { return has_ended_ || work_; });
    if (has_ended_) return;
    const Work work = std::exchange(work_, nullptr);
    lock.unlock();
    Response answer = answer_or_refusal([&] { return work([this] { return must_stop_.load(); }); });
    lock.lock();
    answer_ = std::move(answer);
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t size = ::write(done_fd_, &one, sizeof one);
  }
}

}  // namespace tomofield::view
