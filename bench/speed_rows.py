"""Lists the rows of the speed bench, bench/run, and measures them.

A row's measure(scratch folder) returns {row name: {figure: [values]}}. Most rows return one row
with one value for each figure."""

import dataclasses
import functools
import json
import os
import subprocess
import sys
import typing

import quality_rows
import wide_band
from quality_rows import run_measured

SEED = 101
NOISE = 0.05
KERNELS_FILE = "kernels.json"


@dataclasses.dataclass(frozen=True)
class Row:
    group: str
    name: str
    arguments: str  # the row is measured again when its arguments have changed
    measure: typing.Callable
    # Takes the scratch folder and returns the commit that was measured; None: options.program's.
    commit: typing.Callable = None


@dataclasses.dataclass(frozen=True)
class WideSeries:
    """Describes a series that is too large for a bench. The bench times epochs of a band of `rows`
    detector rows, which are whole leaves. With this field the whole series fits into 10 GiB."""

    width: int = 4096
    thickness: int = 1024
    tilt_step: float = 2  # from -60 to 60 degrees, 61 views
    rows: int = 256
    field: str = "--leaf-size 256 --vertex-spacing 2.5 --rank 16 --margin-spacing 8"
    timed_epochs: int = 2  # at full resolution
    timed_coarse_epochs: int = 4


@dataclasses.dataclass(frozen=True)
class Plan:
    """Lists everything that a run measures."""

    shapes: tuple = ((256, 150), (512, 300), (1024, 300))  # pixels, thickness of yardstick A
    methods: tuple = (("default", "reconstruct"), ("grid", "reconstruct --field grid"),
                      ("sirt", "baseline sirt"))
    wide: WideSeries = WideSeries()
    size: tuple = (("pixels", 128), ("thickness", 64), ("tilt step", 2), ("rank", 16))
    sizes: tuple = (("pixels", (64, 128, 256)), ("thickness", (32, 64, 128)),
                    ("tilt step", (4, 2, 1)), ("rank", (8, 16, 32)))
    size_epochs: int = 4
    kernel_rounds: int = 25


QUICK_FIT = "--epochs 1 --coarse-epochs 0 --tv-penalty concave --rank 4"
QUICK = Plan(shapes=((64, 38),),
             methods=(("default", f"reconstruct {QUICK_FIT}"),
                      ("grid", f"reconstruct --field grid {QUICK_FIT}"),
                      ("sirt", "baseline sirt --iterations 2")),
             wide=WideSeries(width=64, thickness=32, tilt_step=20, rows=32,
                             field="--leaf-size 32 --rank 4"),
             size=(("pixels", 48), ("thickness", 24), ("tilt step", 12), ("rank", 4)),
             sizes=(("pixels", (32, 48)), ("rank", (4, 8))), size_epochs=1, kernel_rounds=1)


def all_rows(options, plan, programs):
    """Returns all rows. `programs` maps names of other programs to commands with placeholders."""
    return [Row("kernels", "kernels", f"{plan.kernel_rounds} rounds",
                functools.partial(measure_kernels, options, plan.kernel_rounds), kernels_commit),
            *reconstruction_rows(options, plan, programs),
            wide_row(options, plan.wide), *size_rows(options, plan)]


def measure_kernels(options, rounds, scratch):
    """Runs bench_kernels. Returns one row for each case, and one row of ratios for each SIMD
    target."""
    if not os.path.exists(options.bench_kernels):
        sys.exit(f"there is no '{options.bench_kernels}': build the target bench_kernels, or choose "
                 "other rows with --only")
    run_measured([options.bench_kernels, os.path.join(scratch, KERNELS_FILE), str(rounds)])
    report = read_kernels(scratch)
    rows = {}
    for target in report["targets"]:
        name = f"kernels {target['target']}"
        rows[name] = {figure: [value] for figure, value in target["ratios"].items()}
        for case in target["cases"]:
            rows[f"{name}: {case['name']}"] = {
                "seconds_a_call": case["seconds"], "flops": [case["flops"]],
                "bytes": [case["bytes"]], "nominal_updates": [case["nominal_updates"]]}
    return rows


def read_kernels(scratch):
    with open(os.path.join(scratch, KERNELS_FILE)) as file:
        return json.load(file)


def kernels_commit(scratch):
    return read_kernels(scratch)["commit"]


def reconstruction_rows(options, plan, programs):
    for shape in plan.shapes:
        title = f"A {shape[0]}/{shape[1]}"
        for method, arguments in plan.methods:
            name = f"{title} {method}"
            yield Row("reconstructions", name, arguments,
                      functools.partial(measure_ours, options, shape, name, arguments))
        for program, command in programs.items():
            name = f"{title} {program}"
            yield Row("reconstructions", name, command,
                      functools.partial(measure_other, options, shape, name, command))


def figures_of(usage):
    return {key: [value] for key, value in usage._asdict().items()}


def yardstick(options, shape):
    return quality_rows.phantom(options, "A", shape[0], NOISE, SEED, shape[1])


def measure_ours(options, shape, name, arguments, scratch):
    folder, volume = yardstick(options, shape), os.path.join(scratch, "volume.mrc")
    command = [options.program, *arguments.split(),
               *quality_rows.series_arguments(folder, shape[1]), "--no-margin", "-o", volume,
               "--overwrite"]
    figures = {"estimated_MiB": [quality_rows.dry_run(command)["MiB"]],
               **figures_of(run_measured(command))}
    scores = quality_rows.score(options, volume, os.path.join(folder, "truth.mrc"), scratch)
    with open(os.path.join(scratch, "volume.json")) as file:
        parameters = json.load(file)["metrics"].get("parameters")
    if parameters is not None:
        figures["parameters"] = [parameters]
    return {name: {**figures, "psnr_dB": [scores["psnr_raw_dB"]],
                   "psnr_affine_dB": [scores["psnr_affine_dB"]]}}


def measure_other(options, shape, name, command, scratch):
    """Runs another program and scores its volume at the best scale and offset, because the program
    may have other units."""
    folder, volume = yardstick(options, shape), os.path.join(scratch, "other.mrc")
    if os.path.exists(volume):
        os.remove(volume)
    places = {"stack": os.path.join(folder, "tilt_series.mrc"),
              "tlt": os.path.join(folder, "tilt_series.tlt"), "thickness": shape[1],
              "output": volume}
    figures = figures_of(run_measured([word.format_map(places) for word in command.split()]))
    if not os.path.exists(volume):
        sys.exit(f"'{command}' ended well but wrote no volume to {{output}}")
    scores = quality_rows.score(options, volume, os.path.join(folder, "truth.mrc"), scratch)
    return {name: {**figures, "psnr_affine_dB": [scores["psnr_affine_dB"]]}}


def wide_row(options, wide):
    name = f"wide {wide.width}x{wide.width}/{wide.thickness}"
    return Row("wide", name, f"{wide.rows} rows {wide.field}",
               functools.partial(measure_wide, options, wide, name))


def default_epochs(command):
    """Returns the default numbers of epochs at full resolution and of coarse epochs.

    `command` is a reconstruct without either option. The numbers follow from the steps that dry
    runs predict. The number at full resolution depends on whether there is a coarse stage."""
    def steps(*options):
        return quality_rows.dry_run([*command, *options])["steps"]

    an_epoch = steps("--epochs", "1", "--coarse-epochs", "0")
    usual, after_one = steps() // an_epoch, steps("--coarse-epochs", "1") // an_epoch
    # Equal numbers mean that there is no coarse stage, whatever --coarse-epochs says.
    full = after_one if after_one == usual else after_one - 1
    return full, usual - full


def measure_wide(options, wide, name, scratch):
    """Extrapolates the core-hours of the whole series from runs of the band.

    A run costs its start, its epochs at full resolution and its coarse epochs. All of them are
    proportional to the number of rows."""
    folder = wide_band.band_series(options, wide)
    command = [options.program, "reconstruct", *wide.field.split(), "--vertex-epochs", "0",
               "--tv-penalty", "concave",
               *quality_rows.series_arguments(folder, wide.thickness), "--mode", "12", "-o",
               os.path.join(scratch, "band.mrc"), "--overwrite"]

    def run(epochs, coarse_epochs):
        return run_measured([*command, "--epochs", str(epochs), "--coarse-epochs",
                             str(coarse_epochs)])

    epochs, coarse_epochs = default_epochs(command)
    start, longer = run(1, 0), run(1 + wide.timed_epochs, 0)
    coarse = run(1, wide.timed_coarse_epochs)
    figures = {"peak_of_band_MiB": [longer.peak_MiB],
               "estimated_of_band_MiB": [quality_rows.dry_run(command)["MiB"]],
               "estimated_of_whole_MiB": [wide_band.estimate_of_whole(options, wide, folder)]}
    for kind, clock in (("core", "core_seconds"), ("wall", "wall_seconds")):
        first, second, third = (getattr(usage, clock) for usage in (start, longer, coarse))
        epoch = (second - first) / wide.timed_epochs
        coarse_epoch = (third - first) / wide.timed_coarse_epochs
        whole = first - epoch + epochs * epoch + coarse_epochs * coarse_epoch
        figures[f"epoch_of_band_{kind}_s"] = [epoch]
        figures[f"coarse_epoch_of_band_{kind}_s"] = [coarse_epoch]
        figures[f"{kind}_hours"] = [whole * wide.width / wide.rows / 3600]
    return {name: figures}


def size_rows(options, plan):
    """One size varied at a time; the size that all axes share is one row."""
    seen = set()
    for axis, values in plan.sizes:
        for value in values:
            size = {**dict(plan.size), axis: value}
            name = size_name(size)
            if name not in seen:
                seen.add(name)
                arguments = (f"reconstruct --tv-penalty concave --epochs {plan.size_epochs} "
                             f"--vertex-epochs 0 --coarse-epochs 0 --rank {size['rank']}")
                yield Row("sizes", name, arguments,
                          functools.partial(measure_size, options, size, name, arguments))


def num_views(tilt_step):
    return round(120 / tilt_step) + 1


def size_name(size):
    return (f"size {size['pixels']}x{size['pixels']}/{size['thickness']}, "
            f"{num_views(size['tilt step'])} views, rank {size['rank']}")


def simulated(options, size):
    """Returns the folder of a simulated series, −60 to 60°, of a specimen that ends in the field of
    view."""
    folder = os.path.join(options.out, "phantoms",
                          f"s{size['pixels']}x{size['thickness']}_{size['tilt step']}")
    quality_rows.simulate(options, folder, "--size", size["pixels"], "--thickness",
                          size["thickness"], f"--tilts=-60:60:{size['tilt step']}", "--no-truth")
    return folder


def measure_size(options, size, name, arguments, scratch):
    series = quality_rows.series_arguments(simulated(options, size), size["thickness"])
    figures = figures_of(run_measured(
        [options.program, *arguments.split(), *series, "--no-margin", "-o",
         os.path.join(scratch, "volume.mrc"), "--overwrite"]))
    return {name: {**figures, "pixels": [size["pixels"] ** 2], "thickness": [size["thickness"]],
                   "views": [num_views(size["tilt step"])], "rank": [size["rank"]]}}
