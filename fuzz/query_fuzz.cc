#include <string_view>

#include "fuzz_input.h"
#include "view/http/request.h"
#include "view/plane.h"

// A request to the server of `view`: its head, its query and the plane that it asks for.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  fuzz::refuse_or([&] {
    const view::Request request = view::parse_request(text);
    view::requested_number(request.parameters, "volume", 1);
    view::requested_plane(request.parameters);
  });
  fuzz::refuse_or([&] { view::requested_plane(view::parse_query(text)); });
  return 0;
}
