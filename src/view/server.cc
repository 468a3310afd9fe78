#include "view/server.h"

#include <fmt/format.h>

#include <bit>
#include <random>
#include <string_view>
#include <utility>

#include "report/page_texts.h"
#include "view/http/http_server.h"
#include "view/page_texts.h"

namespace tomofield::view {
namespace {

static_assert(std::endian::native == std::endian::little, "the page reads little-endian numbers");

// Returns 128 random bits in hexadecimal.
std::string random_key() {
  std::random_device random;
  std::string key;
  for (int word = 0; word < 4; ++word) key += fmt::format("{:08x}", random());
  return key;
}

Response give(std::string_view text, const char* type) {
  return {.type = type, .body = std::string(text), .more_headers = {}};
}

}  // namespace

struct Server::Impl {
  Impl(std::vector<std::unique_ptr<ViewedVolume>> shown, int port)
      : volumes(std::move(shown)), http(port) {}

  std::string own_host() const { return fmt::format("127.0.0.1:{}", http.port()); }
  bool is_own(const std::string& host) const;
  Answer answer(const Request& request) const;
  Answer plane(const Request& request) const;

  std::vector<std::unique_ptr<ViewedVolume>> volumes;
  std::string key = random_key();
  HttpServer http;
};

// Tells whether a request names this server. Browsers leave the usual port of HTTP out.
bool Server::Impl::is_own(const std::string& host) const {
  constexpr int kUsualPort = 80;
  const std::string port = http.port() == kUsualPort && host.find(':') == std::string::npos
                               ? ""
                               : fmt::format(":{}", http.port());
  return host == "127.0.0.1" + port || host == "localhost" + port;
}

Answer Server::Impl::answer(const Request& request) const {
  if (!is_own(request.host))
    return refusal(403, "this server is for the browsers of its own machine");
  if (request.method != "GET") {
    Response response = refusal(405, "only GET is answered");
    response.more_headers = "Allow: GET\r\n";
    return response;
  }
  const std::string start = "/" + key + "/";
  if (!request.path.starts_with(start))
    return refusal(404, "there is no such page: open the address that tomofield printed");
  const std::string name = request.path.substr(start.size());
  constexpr const char* kScript = "text/javascript; charset=utf-8";
  if (name.empty()) return give(view_page(), "text/html; charset=utf-8");
  if (name == "page.css") return give(report::page_style(), "text/css; charset=utf-8");
  if (name == "planes.js") return give(report::planes_script(), kScript);
  if (name == "view.js") return give(view_script(), kScript);
  if (name == "info") return give(info_text(volumes), "application/json");
  if (name == "plane") return plane(request);
  return refusal(404, "there is no such page");
}

Answer Server::Impl::plane(const Request& request) const {
  const auto last = static_cast<std::int64_t>(volumes.size()) - 1;
  const auto index = static_cast<std::size_t>(requested_number(request.parameters, "volume", last));
  const ViewedVolume& volume = *volumes[index];
  return [&volume, plane = requested_plane(request.parameters)](const StopCheck& must_stop) {
    const std::vector<float> values = volume.sample(plane, must_stop);
    const auto* bytes = reinterpret_cast<const char*>(values.data());
    return Response{.type = "application/octet-stream",
                    .body = std::string(bytes, values.size() * sizeof(float)),
                    .more_headers = {}};
  };
}

Server::Server(std::vector<std::unique_ptr<ViewedVolume>> volumes, int port)
    : impl_(std::make_unique<Impl>(std::move(volumes), port)) {}

Server::~Server() = default;

std::string Server::address() const {
  return fmt::format("http://{}/{}/", impl_->own_host(), impl_->key);
}

void Server::run(const std::function<bool()>& must_stop) {
  impl_->http.run([&](const Request& request) { return impl_->answer(request); }, must_stop);
}

}  // namespace tomofield::view
