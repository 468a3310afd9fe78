#include "cli/options/place_options.h"

#include <fmt/format.h>

#include <vector>

#include "cli/options/number_checks.h"
#include "cli/options/table_options.h"

namespace tomofield::cli {
namespace {

CLI::Option* add_boxes(CLI::App& command, const std::string& name, std::vector<base::Box>& boxes,
                       const std::string& help) {
  return command
      .add_option_function<std::vector<std::string>>(
          name,
          [&boxes](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) boxes.push_back(*parse_box(text));
          },
          help)
      ->check(box_check())
      ->type_name(kBoxType)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

}  // namespace

std::optional<base::Box> parse_box(const std::string& text) {
  const auto numbers = parse_whole_numbers(text);
  if (!numbers || numbers->size() != 6) return std::nullopt;
  base::Box box;
  for (std::size_t i = 0; i < 6; ++i) (i < 3 ? box.begin : box.end)[i % 3] = (*numbers)[i];
  return box;
}

CLI::Validator box_check() {
  return {[](std::string& text) -> std::string {
            if (parse_box(text)) return {};
            return fmt::format(
                "a box must be six whole numbers, x0,y0,z0,x1,y1,z1: zero-based voxels, the last "
                "excluded; not {}",
                text);
          },
          ""};
}

void add_region_options(CLI::App& command, const std::string& volume, const char* group,
                        evaluate::Regions& regions) {
  CLI::Option* foreground = add_boxes(
      command, "--foreground", regions.foreground,
      fmt::format("Voxels of {} that show structure; may be given several times", volume));
  CLI::Option* background = add_boxes(
      command, "--background", regions.background,
      fmt::format("Voxels of {} that show no structure; may be given several times", volume));
  foreground->needs(background)->group(group);
  background->needs(foreground)->group(group);
}

CLI::Option* add_profile_option(CLI::App& command, const char* help, const char* group,
                                std::optional<evaluate::LineSegment>& line) {
  return command
      .add_option_function<std::vector<double>>(
          "--profile",
          [&line](const std::vector<double>& v) {
            line = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
          },
          help)
      ->delimiter(',')
      ->expected(6)
      ->check(number_between(-1e9, 1e9))
      ->type_name(kBoxType)
      ->group(group);
}

}  // namespace tomofield::cli
