#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tomofield/options.h"

namespace tomofield::base {

/// The names of an enum's values in the command line, JSON and model files. A specialisation holds
/// `kNames`, a std::array of pairs (value, name).
template <typename Enum>
struct EnumNames;

template <>
struct EnumNames<Contrast> {
  static constexpr std::array kNames{std::pair{Contrast::kDark, "dark"},
                                     std::pair{Contrast::kBright, "bright"}};
};
template <>
struct EnumNames<Alignment> {
  static constexpr std::array kNames{std::pair{Alignment::kOff, "off"},
                                     std::pair{Alignment::kRefine, "refine"},
                                     std::pair{Alignment::kFull, "full"}};
};
template <>
struct EnumNames<FieldKind> {
  static constexpr std::array kNames{std::pair{FieldKind::kVm, "vm"},
                                     std::pair{FieldKind::kGrid, "grid"}};
};
template <>
struct EnumNames<TreeKind> {
  static constexpr std::array kNames{std::pair{TreeKind::kUniform, "uniform"},
                                     std::pair{TreeKind::kAdaptive, "adaptive"}};
};
template <>
struct EnumNames<Activation> {
  static constexpr std::array kNames{std::pair{Activation::kSoftplus, "softplus"},
                                     std::pair{Activation::kIdentity, "identity"}};
};
template <>
struct EnumNames<Engine> {
  static constexpr std::array kNames{std::pair{Engine::kSlab, "slab"},
                                     std::pair{Engine::kRay, "ray"}};
};
template <>
struct EnumNames<Penalty> {
  static constexpr std::array kNames{std::pair{Penalty::kConcave, "concave"},
                                     std::pair{Penalty::kSmooth, "smooth"}};
};
template <>
struct EnumNames<Prior> {
  static constexpr std::array kNames{std::pair{Prior::kTv, "tv"}, std::pair{Prior::kLight, "light"},
                                     std::pair{Prior::kLearned, "learned"}};
};
template <>
struct EnumNames<RingReference> {
  static constexpr std::array kNames{std::pair{RingReference::kMean, "mean"},
                                     std::pair{RingReference::kMax, "max"}};
};
template <>
struct EnumNames<NoiseModel> {
  static constexpr std::array kNames{std::pair{NoiseModel::kWhite, "white"},
                                     std::pair{NoiseModel::kColoured, "coloured"}};
};
template <>
struct EnumNames<VolumeAxes> {
  static constexpr std::array kNames{std::pair{VolumeAxes::kXyz, "xyz"},
                                     std::pair{VolumeAxes::kXzy, "xzy"}};
};
template <>
struct EnumNames<ZarrVersion> {
  static constexpr std::array kNames{std::pair{ZarrVersion::k04, "0.4"},
                                     std::pair{ZarrVersion::k05, "0.5"}};
};
template <>
struct EnumNames<VoxelType> {
  static constexpr std::array kNames{std::pair{VoxelType::kFloat32, "2"},
                                     std::pair{VoxelType::kFloat16, "12"},
                                     std::pair{VoxelType::kInt16, "1"}};
};

/// Returns the name of a value.
template <typename Enum>
constexpr const char* name_of(Enum value) {
  for (const auto& [known, name] : EnumNames<Enum>::kNames)
    if (known == value) return name;
  return "";
}

/// Returns the value with this name, or nothing.
template <typename Enum>
constexpr std::optional<Enum> enum_named(std::string_view text) {
  for (const auto& [value, name] : EnumNames<Enum>::kNames)
    if (text == name) return value;
  return std::nullopt;
}

}  // namespace tomofield::base
