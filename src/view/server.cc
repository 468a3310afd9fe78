#include "view/server.h"

#include <fmt/format.h>
#include <httplib.h>

#include <atomic>
#include <bit>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <string_view>
#include <thread>

#include "base/utf8.h"
#include "report/page_texts.h"
#include "tomofield/error.h"
#include "view/page_texts.h"

namespace tomofield::view {
namespace {

static_assert(std::endian::native == std::endian::little, "the page reads little-endian numbers");

constexpr const char* kHost = "127.0.0.1";

// Returns 128 random bits in hexadecimal.
std::string random_key() {
  std::random_device random;
  std::string key;
  for (int word = 0; word < 4; ++word) key += fmt::format("{:08x}", random());
  return key;
}

nlohmann::json description(const ViewedVolume& volume) {
  return {{"title", base::utf8_text(volume.title())},
          {"note", volume.note()},
          {"size", volume.size()},
          {"voxel_size_A", volume.voxel_size_A()},
          {"contrast", {volume.contrast().black, volume.contrast().white}}};
}

void refuse(int status, std::string_view reason, httplib::Response& response) {
  response.status = status;
  response.set_content(std::string(reason) + "\n", "text/plain; charset=utf-8");
}

void give(std::string_view text, const char* type, httplib::Response& response) {
  response.set_content(text.data(), text.size(), type);
}

}  // namespace

struct Server::Impl {
  std::vector<std::unique_ptr<ViewedVolume>> volumes;
  std::string key = random_key();
  int port = 0;
  httplib::Server http;
  std::mutex one_plane;  // a plane is computed on all threads

  void listen(int wanted_port);
  void answer(const httplib::Request& request, httplib::Response& response);
  void give_plane(const httplib::Request& request, httplib::Response& response);
  std::string info() const;
};

void Server::Impl::listen(int wanted_port) {
  // Without SO_REUSEPORT, which httplib sets by default: two servers would share a port.
  http.set_socket_options([](int socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  http.new_task_queue = [] { return new httplib::ThreadPool(8); };
  http.set_keep_alive_timeout(1);  // the server waits for that long when it ends
  http.set_keep_alive_max_count(10000);
  http.set_tcp_nodelay(true);
  http.set_default_headers({{"Cache-Control", "no-store"},
                            {"X-Content-Type-Options", "nosniff"},
                            {"Referrer-Policy", "no-referrer"},
                            {"Cross-Origin-Resource-Policy", "same-origin"},
                            {"Content-Security-Policy",
                             "default-src 'none'; connect-src 'self'; script-src 'self'; "
                             "style-src 'self'; img-src data:; frame-ancestors 'none'"}});
  http.set_pre_routing_handler(
      [this](const httplib::Request& request, httplib::Response& response) {
        try {
          answer(request, response);
        } catch (const Error& error) {
          refuse(400, error.what(), response);
        } catch (const std::exception& error) {
          refuse(500, error.what(), response);
        }
        return httplib::Server::HandlerResponse::Handled;
      });
  port = wanted_port;
  if (wanted_port == 0) port = http.bind_to_any_port(kHost);
  if (port <= 0 || (wanted_port != 0 && !http.bind_to_port(kHost, wanted_port)))
    throw Error(
        fmt::format("port {} of {} cannot be used: another program has it, or it needs "
                    "more rights; leave --port out, and a free one is taken",
                    wanted_port, kHost));
}

void Server::Impl::answer(const httplib::Request& request, httplib::Response& response) {
  const std::string host = request.get_header_value("Host");
  if (host != fmt::format("{}:{}", kHost, port) && host != fmt::format("localhost:{}", port))
    return refuse(403, "this server is for the browsers of its own machine", response);
  if (request.method != "GET") {
    response.set_header("Allow", "GET");
    return refuse(405, "only GET is answered", response);
  }
  const std::string start = "/" + key + "/";
  if (!request.path.starts_with(start))
    return refuse(404, "there is no such page: open the address that tomofield printed", response);
  const std::string name = request.path.substr(start.size());
  constexpr const char* kScript = "text/javascript; charset=utf-8";
  if (name.empty()) return give(view_page(), "text/html; charset=utf-8", response);
  if (name == "page.css") return give(report::page_style(), "text/css; charset=utf-8", response);
  if (name == "planes.js") return give(report::planes_script(), kScript, response);
  if (name == "view.js") return give(view_script(), kScript, response);
  if (name == "info") return give(info(), "application/json", response);
  if (name == "plane") return give_plane(request, response);
  refuse(404, "there is no such page", response);
}

void Server::Impl::give_plane(const httplib::Request& request, httplib::Response& response) {
  const Parameters parameters = [&](const char* name) -> std::optional<std::string> {
    if (!request.has_param(name)) return std::nullopt;
    return request.get_param_value(name);
  };
  const auto last = static_cast<std::int64_t>(volumes.size()) - 1;
  const auto index = static_cast<std::size_t>(requested_number(parameters, "volume", last));
  const Plane plane = requested_plane(parameters);
  const std::lock_guard lock(one_plane);
  const std::vector<float> values = volumes[index]->sample(plane);
  response.set_content(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float),
                       "application/octet-stream");
}

std::string Server::Impl::info() const {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& volume : volumes) all.push_back(description(*volume));
  return nlohmann::json{{"volumes", all}, {"largest_side_px", kLargestSide_px}}.dump();
}

Server::Server(std::vector<std::unique_ptr<ViewedVolume>> volumes, int port)
    : impl_(std::make_unique<Impl>()) {
  impl_->volumes = std::move(volumes);
  impl_->listen(port);
}

Server::~Server() = default;

std::string Server::address() const {
  return fmt::format("http://{}:{}/{}/", kHost, impl_->port, impl_->key);
}

void Server::run(const std::function<bool()>& must_stop) {
  using std::chrono_literals::operator""ms;
  std::atomic<bool> has_ended = false;
  std::thread watch([&] {
    while (!has_ended && !(must_stop() && impl_->http.is_running()))
      std::this_thread::sleep_for(100ms);
    impl_->http.stop();
  });
  impl_->http.listen_after_bind();
  has_ended = true;
  watch.join();
}

}  // namespace tomofield::view
