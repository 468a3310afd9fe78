"""Names the real series that benches reconstruct, and the options for each of them. The data are
not part of the project: a folder that --data names has a folder for each set."""

import os

# The stack, the tilts, and the options of `compare` and `reconstruct`.
SETS = {
    "exosome_cryo": ("exosome_341x480.ali", "exosome.tlt",
                     "--contrast dark --thickness 160 --bin 2 --hold-out 8"),
    "idp_haadf": ("haadf_tilt_tomviz_aligned.ali", "haadf_tilt_raw.rawtlt",
                  "--contrast bright --thickness 32 --view-scale on --hold-out 5"),
    "ta_film": ("area24.ali", "ta_film.tlt",
                "--contrast bright --thickness 151 --hand -1 --hold-out 8"),
}


def arguments_of(data, name):
    """Returns the arguments that hand a set of the folder `data` to the program."""
    stack, tilts, words = SETS[name]
    folder = os.path.join(data, name)
    return [os.path.join(folder, stack), "--tlt", os.path.join(folder, tilts), *words.split()]
