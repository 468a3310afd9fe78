#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "view/http/request.h"

namespace tomofield::view {

using Clock = std::chrono::steady_clock;

/// What a request is answered with.
struct Response {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::string more_headers;  ///< each with its line end
};

/// The connection of a browser: a socket that is never waited for. Every state has a time after
/// which the connection is not worth keeping, so that no peer holds one by doing nothing or by
/// doing it slowly.
class Connection {
 public:
  enum class State {
    kIdle,      ///< nothing of a request has come
    kReading,   ///< a part of its head has come
    kWaiting,   ///< for the answer
    kWriting,   ///< the answer
    kDraining,  ///< the answer is sent and the socket is about to close
    kClosed     ///< by the peer, or it took too long
  };

  /// Takes over a socket that does not block.
  explicit Connection(int socket);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  int socket() const { return socket_; }
  State state() const { return state_; }
  /// Says whether a request is being answered.
  bool is_at_work() const { return state_ == State::kWaiting || state_ == State::kWriting; }
  /// Returns the events that poll() should wait for.
  short events() const;
  /// Returns the bytes of the answer in memory.
  std::size_t held_bytes() const { return output_.size(); }
  Clock::time_point since() const { return since_; }  ///< of the state
  /// Says whether the peer has taken nothing of its answer for a second.
  bool is_stuck(Clock::time_point now) const;

  /// Reads or writes what is possible without waiting, after poll() has found an event. A peer that
  /// hangs up while its answer is computed wants none.
  void advance();
  /// Closes the connection if its state has taken too long.
  void check_time(Clock::time_point now);
  /// Says whether the head of a request is whole, or too long.
  bool has_head() const;
  /// Returns this request and waits for its answer. Throws Error for a head that is no request or
  /// too long.
  Request take_request();
  /// Begins to send an answer. Afterwards the connection closes unless the request keeps it open.
  void answer(Response response, bool keeps_open);

 private:
  void enter(State state);
  void read();
  void write();

  int socket_;
  State state_ = State::kIdle;
  Clock::time_point since_ = Clock::now();
  std::string input_, output_;
  std::size_t sent_ = 0;
  Clock::time_point last_sent_;
  bool wants_body_ = true;  // HEAD has only the head of an answer
  bool keeps_open_ = false;
};

}  // namespace tomofield::view
