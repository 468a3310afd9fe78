#pragma once

#include <functional>
#include <memory>
#include <variant>

#include "view/http/worker.h"

namespace tomofield::view {

/// An answer, or the work that computes it.
using Answer = std::variant<Response, Work>;

/// A server of HTTP on the loopback interface, which no peer can stall or make take much memory:
///
/// - One thread talks to all connections and waits for none of them. There are at most 128; one
///   more closes the one that has been idle for longest.
/// - The head of a request has at most 32 KiB and 5 s, and bodies are not read.
/// - Work is done one after another, for at most 32 requests that wait; others get status 503. It
///   does not begin while 256 MiB of answers are not sent yet, and stops if its peer hangs up. Work
///   that waits for this closes connections whose peers have taken nothing for a second.
class HttpServer {
 public:
  /// Listens on a port of 127.0.0.1; 0 chooses a free one. Throws Error if the port is taken.
  explicit HttpServer(int port);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const;
  /// Answers requests until `must_stop` returns true, which is asked ten times a second. The
  /// handler is called on this thread; an Error that it throws becomes status 400.
  void run(const std::function<Answer(const Request&)>& handler, const StopCheck& must_stop);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tomofield::view
