"""Runs the cases of bench/gate and reads what came of them: the settings that the program chose,
its figures, and its picture of the central XY slice. A run is kept in a folder of its own until the
program or the command changes."""

import collections
import hashlib
import json
import os
import shlex
import shutil

import numpy as np
from PIL import Image

import quality_rows
import readme_page
import real_series

SIZE, NOISE, SEED = 128, 0.05, 1  # of the phantoms; ./demo reconstructs A with the same
LONGEST_SIDE = 256  # pixels of a picture that is kept
# The parts of NAME.json that state settings: what trials chose, and all options that were used.
SETTINGS = (("chosen", ("metrics", "tuning", "chosen")), ("fit", ("options", "fit")),
            ("field", ("options", "field")))

# `settings` and `values` are dictionaries, `picture` is an array of grey values [y, x].
Result = collections.namedtuple("Result", "settings values picture")


def add_arguments(parser):
    """Adds the options of the scripts that run cases."""
    parser.add_argument("out", help="folder of the runs; a second run goes on")
    parser.add_argument("--program",
                        default=os.path.join(quality_rows.PROJECT, "build/release/tomofield"))
    parser.add_argument("--data", type=os.path.realpath,
                        default=os.path.join(quality_rows.PROJECT, "../shared/data"),
                        help="folder of the real data, a folder for each set")


class Absent(Exception):
    """Says which data a case lacks."""


def folder_of_set(options, name):
    folder = os.path.join(options.data, name)
    if not os.path.isdir(folder):
        raise Absent(f"there is no folder {folder}")
    return folder


def real_arguments(options, name):
    folder_of_set(options, name)
    return real_series.arguments_of(options.data, name)


def readme_arguments(options):
    """Returns the arguments of the README's command, without its output."""
    folder = folder_of_set(options, "exosome_cryo")
    words = shlex.split(readme_page.command())
    words = words[:words.index("-o")]
    files = [os.path.join(folder, word) for word in words]
    return [file if os.path.isfile(file) else word for file, word in zip(files, words)]


def yardstick_arguments(options, kind):
    """Returns the arguments for the series of a phantom, which is simulated first."""
    folder = phantom_folder(options, kind)
    thickness = quality_rows.thickness_of(SIZE)
    quality_rows.run_measured([options.program, "simulate", folder, "--yardstick", kind, "--size",
                               str(SIZE), "--thickness", str(thickness), "--noise", str(NOISE),
                               "--seed", str(SEED), "--overwrite"])
    words = quality_rows.series_arguments(folder, thickness)
    return words + (["--no-margin"] if kind == "a" else [])


def phantom_folder(options, kind):
    return os.path.join(options.out, "phantoms", kind)


# The name of each case, and what gives the arguments of its reconstruction.
CASES = {
    "exosomes": readme_arguments,
    "idp_haadf": lambda options: real_arguments(options, "idp_haadf"),
    "ta_film": lambda options: real_arguments(options, "ta_film"),
    "yardstick_a": lambda options: yardstick_arguments(options, "a"),
    "yardstick_b": lambda options: yardstick_arguments(options, "b"),
    "yardstick_c": lambda options: yardstick_arguments(options, "c"),
}


def digest(path):
    """Returns the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def reconstruct(options, name):
    """Runs a case unless the same program has run it with the same arguments. Returns its folder,
    which holds volume.mrc and what the program writes beside it, and the Usage of the run. Raises
    Absent if the data are absent."""
    folder = os.path.join(options.out, name)
    key = [digest(options.program), *CASES[name](options)]
    record = os.path.join(folder, "run.json")
    if os.path.exists(record) and read_json(record)["key"] == key:
        return folder, quality_rows.Usage(*read_json(record)["usage"])
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    usage = quality_rows.run_measured([options.program, "reconstruct", *key[1:], "-o",
                                       os.path.join(folder, "volume.mrc")])
    with open(record, "w", encoding="utf-8") as file:
        json.dump({"key": key, "usage": usage}, file)
    return folder, usage


def result_of(options, name):
    """Runs a case and returns its Result."""
    folder, _ = reconstruct(options, name)
    volume = os.path.join(folder, "volume.mrc")
    record = read_json(os.path.join(folder, "volume.json"))
    values = figures(record["metrics"])
    if name.startswith("yardstick_"):
        truth = os.path.join(phantom_folder(options, name[-1]), "truth.mrc")
        values["psnr_dB"] = quality_rows.score(options, volume, truth, folder)["psnr_affine_dB"]
    picture = read_slice(os.path.join(folder, "volume_xy.png"))
    return Result(settings(record), values, picture)


def settings(record):
    """Returns the settings that a NAME.json states, as {"fit.epochs": 10, …}."""
    found = {}
    for title, keys in SETTINGS:
        part = record
        for key in keys:
            part = (part or {}).get(key)
        found.update({f"{title}.{key}": value for key, value in (part or {}).items()})
    return found


def figures(metrics):
    """Returns the figures that a NAME.json states. The held-out error is that of --hold-out, or
    else the median over the views that the chosen trial predicted."""
    verdict, held_out = metrics["verdict"], metrics["held_out"]
    found = {"residual": verdict["residual"], "speckle_percent": 100 * verdict["speckle"],
             "face_jump": verdict["face_jump"]["both"], "beads": metrics["mask"]["beads"]}
    if held_out or verdict["held_out"]:
        found["held_out_error"] = held_out["error"] if held_out else verdict["held_out"]["median"]
    return found


def read_slice(path):
    """Returns the grey values [y, x] of a picture of a slice, averaged()."""
    with Image.open(path) as picture:
        return averaged(picture)


def averaged(picture):
    """Returns the grey values [y, x] of a picture. Those of a large one are averaged over squares of
    pixels."""
    return np.array(picture.convert("L").reduce(-(-max(picture.size) // LONGEST_SIDE)))
