#include "view/http/http_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <utility>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::view {
namespace {

constexpr std::size_t kMostConnections = 128;
constexpr std::size_t kMostWaiting = 32;              // for work
constexpr std::size_t kMostHeldBytes = 256ull << 20;  // of answers when work begins
constexpr int kStopInterval_ms = 100;

using State = Connection::State;

// Returns a socket that listens, and throws Error if the port cannot be had.
int listening_socket(int port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  // Without SO_REUSEPORT, by which two servers would share a port.
  const int yes = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (socket >= 0 &&
      ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
      ::listen(socket, kMostConnections) == 0)
    return socket;
  if (socket >= 0) ::close(socket);
  throw Error(
      fmt::format("port {} of 127.0.0.1 cannot be used: another program has it, or it needs more "
                  "rights; leave --port out, and a free one is taken",
                  port));
}

// A request whose answer takes time.
struct Waiting {
  Connection* connection;  // null after it has closed
  bool keeps_open;
  Work work;
};

}  // namespace

struct HttpServer::Impl {
  explicit Impl(int port) : listener(listening_socket(port)) {}
  ~Impl() { ::close(listener); }

  void wait_for_events();
  void accept_all();
  void make_room();
  void take_request(Connection& connection);
  void finish_work();
  void begin_work();
  std::size_t held_bytes() const;
  void close_stuck();
  void forget_closed();

  int listener;
  std::function<Answer(const Request&)> handler;
  std::vector<std::unique_ptr<Connection>> connections;
  std::deque<Waiting> waiting;  // the first is being worked on if `is_working`
  bool is_working = false;
  Worker worker;
};

// Waits until a socket can be read or written, or work is done, and advances the connections.
void HttpServer::Impl::wait_for_events() {
  std::vector<pollfd> polled{{listener, POLLIN, 0}, {worker.done_fd(), POLLIN, 0}};
  for (const auto& connection : connections)
    polled.push_back({connection->socket(), connection->events(), 0});
  if (::poll(polled.data(), polled.size(), kStopInterval_ms) <= 0) return;
  for (std::size_t i = 0; i < connections.size(); ++i)
    if (polled[i + 2].revents != 0) connections[i]->advance();
  if (polled[0].revents != 0) accept_all();
}

void HttpServer::Impl::accept_all() {
  while (true) {
    const int socket = ::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket < 0) {
      if (errno == EMFILE || errno == ENFILE) make_room();
      return;
    }
    const int yes = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    connections.push_back(std::make_unique<Connection>(socket));
    if (connections.size() > kMostConnections) make_room();
  }
}

// Closes the connection that has waited for longest without a request, if there is one.
void HttpServer::Impl::make_room() {
  const auto rank = [](const std::unique_ptr<Connection>& connection) {
    return std::pair(connection->is_at_work(), connection->since());
  };
  const auto first = std::ranges::min_element(connections, {}, rank);
  if (first != connections.end() && !(*first)->is_at_work()) connections.erase(first);
}

// Answers the request of a connection, if its head is whole, or lets it wait for its answer.
void HttpServer::Impl::take_request(Connection& connection) {
  if (!connection.has_head()) return;
  bool keeps_open = false;
  Answer answer = answer_or_refusal([&] {
    const Request request = connection.take_request();
    keeps_open = request.keeps_open && !request.has_body;
    return handler(request);
  });
  // A refusal ends the connection: who is refused many times at once and takes no answer would
  // otherwise hold it as one that is at work.
  if (Response* at_once = std::get_if<Response>(&answer))
    connection.answer(std::move(*at_once), keeps_open && at_once->status == 200);
  else if (waiting.size() >= kMostWaiting)
    connection.answer(refusal(503, "too many requests wait: ask again later"), false);
  else
    waiting.push_back({&connection, keeps_open, std::get<Work>(std::move(answer))});
}

void HttpServer::Impl::finish_work() {
  std::optional<Response> answer = worker.take_answer();
  if (!answer) return;
  const Waiting done = std::move(waiting.front());
  waiting.pop_front();
  is_working = false;
  if (done.connection) done.connection->answer(*std::move(answer), done.keeps_open);
}

std::size_t HttpServer::Impl::held_bytes() const {
  std::size_t held = 0;
  for (const auto& connection : connections) held += connection->held_bytes();
  return held;
}

void HttpServer::Impl::close_stuck() {
  const Clock::time_point now = Clock::now();
  std::erase_if(connections, [&](const auto& connection) { return connection->is_stuck(now); });
}

void HttpServer::Impl::begin_work() {
  if (is_working || waiting.empty()) return;
  if (held_bytes() > kMostHeldBytes) return close_stuck();
  worker.start(waiting.front().work);
  is_working = true;
}

// Removes the connections that have closed, and the work for them.
void HttpServer::Impl::forget_closed() {
  const Clock::time_point now = Clock::now();
  for (const auto& connection : connections) connection->check_time(now);
  const auto is_closed = [](const std::unique_ptr<Connection>& connection) {
    return connection->state() == State::kClosed;
  };
  for (Waiting& request : waiting) {
    if (request.connection && request.connection->state() == State::kClosed)
      request.connection = nullptr;
  }
  if (is_working && !waiting.front().connection) worker.stop();
  std::erase_if(connections, is_closed);
  const auto first = waiting.begin() + (is_working ? 1 : 0);
  waiting.erase(std::remove_if(first, waiting.end(),
                               [](const Waiting& request) { return !request.connection; }),
                waiting.end());
}

HttpServer::HttpServer(int port) : impl_(std::make_unique<Impl>(port)) {}
HttpServer::~HttpServer() = default;

int HttpServer::port() const {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  ::getsockname(impl_->listener, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

void HttpServer::run(const std::function<Answer(const Request&)>& handler,
                     const StopCheck& must_stop) {
  impl_->handler = handler;
  while (!must_stop()) {
    impl_->wait_for_events();
    impl_->finish_work();
    impl_->forget_closed();
    for (const auto& connection : impl_->connections) impl_->take_request(*connection);
    impl_->begin_work();
  }
}

}  // namespace tomofield::view
