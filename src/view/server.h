#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "view/viewed_volume.h"

namespace tomofield::view {

/// Serves a page that shows volumes to the browsers of this machine, until it is told to stop.
///
/// It listens on the loopback interface alone. Other users of the machine could reach that too, so
/// its address has a random key that every request must name. It answers GET alone, knows four
/// files that the program contains, and reads no path from a request. A request whose Host header
/// is another one's is refused, so that no web page can reach the server by a name that it lets
/// point here (DNS rebinding).
class Server {
 public:
  /// Listens on a port; 0 chooses a free one. Throws Error if the port is taken.
  Server(std::vector<std::unique_ptr<ViewedVolume>> volumes, int port);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Returns the address of the page.
  std::string address() const;
  /// Answers requests until `must_stop` returns true, which is asked several times a second.
  void run(const std::function<bool()>& must_stop);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tomofield::view
