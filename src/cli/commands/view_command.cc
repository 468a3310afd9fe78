#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/number_checks.h"
#include "cli/terminal/console.h"
#include "view/server.h"
#include "view/viewed_volume.h"

namespace tomofield::cli {
namespace {

struct ViewArguments {
  std::filesystem::path volume;
  std::optional<std::filesystem::path> second;
  int port = 0;
};

void run_view(const ViewArguments& arguments) {
  std::vector<std::unique_ptr<view::ViewedVolume>> volumes;
  volumes.push_back(view::open_volume(arguments.volume));
  if (arguments.second) volumes.push_back(view::open_volume(*arguments.second));
  view::Server server(std::move(volumes), arguments.port);
  stop_on_signals();
  print("{}\nOpen this address in a browser of this machine. Ctrl-C ends the view.\n",
        server.address());
  if (!output_fault().empty()) return;  // nobody knows the address; the program says so
  server.run(stop_was_requested);
}

}  // namespace

void add_view_command(CLI::App& program) {
  auto arguments = std::make_shared<ViewArguments>();
  CLI::App* command = program.add_subcommand(
      "view", "Show a model or an MRC volume, or two side by side, in a browser of this machine");
  command->add_option("volume", arguments->volume, "Model (.h5) of reconstruct, or MRC volume")
      ->required();
  command->add_option("second", arguments->second, "Model or volume to show beside it");
  command
      ->add_option("--port", arguments->port, "Port of 127.0.0.1 to listen on; 0 takes a free one")
      ->check(number_between(0, 65535))
      ->capture_default_str();
  add_common_options(*command);
  command->callback([arguments] { run_view(*arguments); });
}

}  // namespace tomofield::cli
