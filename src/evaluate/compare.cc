#include "evaluate/compare.h"

namespace tomofield::evaluate {

Comparison compare(const VolumePair& pair) {
  Comparison comparison;
  comparison.box = pair.box;
  comparison.psnr = psnr(pair.first.data, pair.second.data);
  comparison.ssim = ssim(pair.first, pair.second, comparison.psnr.peak, comparison.psnr.scale,
                         comparison.psnr.offset);
  return comparison;
}

nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth) {
  return {{"reconstruction", reconstruction.string()},
          {"truth", truth.string()},
          {"psnr_raw_dB", comparison.psnr.raw_dB},
          {"psnr_affine_dB", comparison.psnr.affine_dB},
          {"ssim_raw", comparison.ssim.raw},
          {"ssim_affine", comparison.ssim.affine},
          {"correlation", comparison.psnr.correlation},
          {"scale", comparison.psnr.scale},
          {"offset", comparison.psnr.offset},
          {"peak", comparison.psnr.peak},
          {"box_first", comparison.box.begin},
          {"box_last", comparison.box.end}};
}

}  // namespace tomofield::evaluate
