#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "evaluate/compare.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

struct EvaluateArguments {
  std::string reconstruction;
  std::string truth;
  std::vector<std::int64_t> box;
  std::string json;
  bool overwrite = false;
};

void print_table(const evaluate::Comparison& comparison) {
  const auto& [psnr, ssim, box] = comparison;
  const base::Shape3 shape = box.shape();
  fmt::print("              raw    affine\n");
  fmt::print("PSNR (dB) {:8.3f}  {:8.3f}\n", psnr.raw_dB, psnr.affine_dB);
  fmt::print("SSIM      {:8.5f}  {:8.5f}\n", ssim.raw, ssim.affine);
  fmt::print("correlation {:.5f}, scale {:.5f}, offset {:.5f}, peak {:.5f}\n", psnr.correlation,
             psnr.scale, psnr.offset, psnr.peak);
  fmt::print("box {} × {} × {} voxels from {},{},{} of the truth\n", shape.nx, shape.ny, shape.nz,
             box.first[0], box.first[1], box.first[2]);
}

void run_evaluate(const EvaluateArguments& arguments) {
  if (!arguments.json.empty() && !arguments.overwrite && std::filesystem::exists(arguments.json))
    throw Error(fmt::format("'{}' exists: give another name, or --overwrite to replace it",
                            arguments.json));
  std::optional<evaluate::Box> box;
  if (!arguments.box.empty()) {
    box.emplace();
    std::copy_n(arguments.box.begin(), 3, box->first.begin());
    std::copy_n(arguments.box.begin() + 3, 3, box->last.begin());
  }
  const auto comparison = evaluate::compare_files(arguments.reconstruction, arguments.truth, box);
  if (!arguments.json.empty()) {
    io::write_json(arguments.json, evaluate::comparison_json(comparison, arguments.reconstruction,
                                                             arguments.truth));
  }
  print_table(comparison);
}

}  // namespace

void add_evaluate_command(CLI::App& program) {
  auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App* command = program.add_subcommand(
      "evaluate",
      "Score a volume against the truth: PSNR and SSIM, raw and after the best scale "
      "and offset");
  command->add_option("reconstruction", arguments->reconstruction, "MRC volume")->required();
  command->add_option("truth", arguments->truth, "MRC volume")->required();
  command
      ->add_option("--box", arguments->box,
                   "x0,y0,z0,x1,y1,z1: voxels of the truth, zero-based, the last excluded")
      ->delimiter(',')
      ->expected(6);
  command->add_option("--json", arguments->json, "Write the figures to this file");
  command->add_flag("--overwrite", arguments->overwrite, "Replace the file of --json");
  command->callback([arguments] { run_evaluate(*arguments); });
}

}  // namespace tomofield::cli
