#include "projects/formats.h"

namespace tomofield::projects {
namespace {

constexpr Format kFormats[] = {
    {.name = "eTomo's tilt.com",
     .extension = ".com",
     .is_main_file =
         [](std::string_view name) {
           return name == "tilt.com" || name == "tilta.com" || name == "tiltb.com";
         },
     .read = read_imod_project},
    {.name = "AreTomo's alignment (.aln)",
     .extension = ".aln",
     .is_main_file =
         [](std::string_view name) {
           // NAME_align.aln is a result of this program.
           return name.ends_with(".aln") && !name.ends_with("_align.aln");
         },
     .read = read_aretomo_project},
    {.name = "RELION's tomograms.star",
     .extension = ".star",
     .is_main_file = [](std::string_view name) { return name == "tomograms.star"; },
     .read = read_relion_project,
     .has_several = true},
    {.name = "Warp's .tomostar",
     .extension = ".tomostar",
     .is_main_file = [](std::string_view name) { return name.ends_with(".tomostar"); },
     .read = read_warp_project},
    {.name = "Warp's XML",
     .extension = ".xml",
     .is_main_file = [](std::string_view name) { return name.ends_with(".xml"); },
     .word = "<TiltSeries",  // frames have XML files too
     .read = read_warp_project,
     .rank = 1},
    {.name = "eTomo's dataset (.edf)",
     .extension = ".edf",
     .is_main_file = [](std::string_view name) { return name.ends_with(".edf"); },
     .read = read_edf_project,
     .rank = 1},
    {.name = "SerialEM's metadata (.mdoc)",
     .extension = ".mdoc",
     .is_main_file = [](std::string_view name) { return name.ends_with(".mdoc"); },
     .word = "[ZValue",  // movies have files with [FrameSet = 0] alone
     .read = read_mdoc_project,
     .rank = 2},
};

}  // namespace

std::span<const Format> all_formats() { return kFormats; }

}  // namespace tomofield::projects
