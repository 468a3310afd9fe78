#include "view/http/connection.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string_view>
#include <utility>

#include "tomofield/error.h"

namespace tomofield::view {
namespace {

using std::chrono_literals::operator""s;

constexpr auto kLongestIdle = 60s;
constexpr auto kLongestHead = 5s;
constexpr auto kLongestDrain = 1s;
constexpr auto kLongestPause = 1s;  // of a peer that takes an answer, if others need its memory
constexpr std::size_t kSlowestRate = 256 << 10;  // bytes of an answer a second, after 10 s

// These tell a browser to keep nothing, and let the page load nothing from elsewhere.
constexpr const char* kHeaders =
    "Cache-Control: no-store\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Content-Security-Policy: default-src 'none'; connect-src 'self'; script-src 'self'; "
    "style-src 'self'; img-src data:; frame-ancestors 'none'\r\n";

constexpr std::string_view kEndOfHead = "\r\n\r\n";

std::string_view reason_of(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 400:
      return "Bad Request";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 503:
      return "Service Unavailable";
    default:
      return "Internal Server Error";
  }
}

// Says whether a call failed only because it would have waited.
bool would_wait() { return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }

}  // namespace

Connection::Connection(int socket) : socket_(socket) {}

Connection::~Connection() { ::close(socket_); }

short Connection::events() const {
  switch (state_) {
    case State::kWriting:
      return POLLOUT;
    case State::kWaiting:
      return POLLRDHUP;
    case State::kClosed:
      return 0;
    default:
      return POLLIN;
  }
}

void Connection::enter(State state) {
  state_ = state;
  since_ = Clock::now();
}

void Connection::advance() {
  switch (state_) {
    case State::kWriting:
      return write();
    case State::kWaiting:
      return enter(State::kClosed);
    case State::kClosed:
      return;
    default:
      return read();
  }
}

bool Connection::is_stuck(Clock::time_point now) const {
  return state_ == State::kWriting && now - last_sent_ > kLongestPause;
}

void Connection::check_time(Clock::time_point now) {
  const auto is_over = [&](auto longest) { return now - since_ > longest; };
  const auto longest_write = 10s + std::chrono::seconds(output_.size() / kSlowestRate);
  if ((state_ == State::kIdle && is_over(kLongestIdle)) ||
      (state_ == State::kReading && is_over(kLongestHead)) ||
      (state_ == State::kWriting && is_over(longest_write)) ||
      (state_ == State::kDraining && is_over(kLongestDrain)))
    enter(State::kClosed);
}

void Connection::read() {
  std::array<char, 4096> bytes;
  const ssize_t count = ::recv(socket_, bytes.data(), bytes.size(), 0);
  if (count < 0 && would_wait()) return;
  if (count <= 0) return enter(State::kClosed);
  if (state_ == State::kDraining) return;
  input_.append(bytes.data(), static_cast<std::size_t>(count));
  if (state_ == State::kIdle) enter(State::kReading);
}

void Connection::write() {
  const ssize_t count =
      ::send(socket_, output_.data() + sent_, output_.size() - sent_, MSG_NOSIGNAL);
  if (count < 0 && would_wait()) return;
  if (count < 0) return enter(State::kClosed);
  sent_ += static_cast<std::size_t>(count);
  last_sent_ = Clock::now();
  if (sent_ < output_.size()) return;
  output_ = std::string();  // gives its memory back
  sent_ = 0;
  if (keeps_open_) return enter(input_.empty() ? State::kIdle : State::kReading);
  // The peer may still be sending: a socket that is closed then takes the answer back.
  ::shutdown(socket_, SHUT_WR);
  enter(State::kDraining);
}

bool Connection::has_head() const {
  return state_ == State::kReading &&
         (input_.size() > kLargestHead || input_.find(kEndOfHead) != std::string::npos);
}

Request Connection::take_request() {
  enter(State::kWaiting);
  wants_body_ = true;
  const std::size_t end = input_.find(kEndOfHead);
  if (end > kLargestHead)
    throw Error(fmt::format("the head of a request may have {} bytes", kLargestHead));
  Request request = parse_request(std::string_view(input_).substr(0, end));
  input_.erase(0, end + kEndOfHead.size());
  wants_body_ = request.method != "HEAD";
  return request;
}

void Connection::answer(Response response, bool keeps_open) {
  keeps_open_ = keeps_open;
  const std::string head = fmt::format(
      "HTTP/1.1 {} {}\r\n{}{}Content-Type: {}\r\nContent-Length: {}\r\nConnection: {}\r\n\r\n",
      response.status, reason_of(response.status), kHeaders, response.more_headers, response.type,
      response.body.size(), keeps_open ? "keep-alive" : "close");
  output_ = wants_body_ ? std::move(response.body) : std::string();
  output_.insert(0, head);
  enter(State::kWriting);
  last_sent_ = since_;
}

}  // namespace tomofield::view
