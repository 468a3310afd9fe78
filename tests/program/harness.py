"""Runs the program for the tests and makes a small series to run it on. tests/conftest.py sets
which program runs and where the tests write."""

import copy
import glob
import json
import os
import shutil
import signal
import subprocess
import tempfile

import h5py
import mrcfile
import numpy as np

PROGRAM = os.environ["TOMOFIELD_PROGRAM"]
SCRATCH = None  # a folder of the running test, or of its module while a module's fixture is made

WIDTH, HEIGHT, THICKNESS = 48, 36, 24
PIXEL_SIZE = 13.37
TILTS = np.arange(-60, 61, 6.0)
# A fit of a tenth of a second that still finds the specimen.
QUICK = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin", "--field", "vm",
         "--leaf-size", 16, "--rank", 6, "--epochs", 8, "--subsets", 7, "--tv-penalty", "concave",
         "--view-scale", "off"]


def tomofield(*arguments, **keywords):
    """Runs the program to its end; text comes back as stdout and stderr."""
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True,
                          **keywords)


def start(*arguments, **keywords):
    """Starts the program and returns at once."""
    return subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, **keywords)


def succeed(*arguments, **keywords):
    result = tomofield(*arguments, **keywords)
    assert result.returncode == 0, (arguments, result.returncode, result.stderr)
    return result


def stop_after_a_step(run, number=signal.SIGTERM, timeout=None):
    """Sends a run a signal after its first step and returns what it said after that. The run may
    have ended before."""
    for line in run.stderr:
        if line.startswith("reconstruct "):  # a step is done
            break
    run.send_signal(number)
    _, errors = run.communicate(timeout=timeout)
    return errors


def stop_after_first_step(command, number=signal.SIGTERM):
    """Runs a command, stops it after its first step and returns the run and what it said since."""
    run = start(*command)
    return run, stop_after_a_step(run, number)


def finish_with_stops(command, after_stop, most):
    """Runs a resumable command to its end, stopped by SIGTERM after its first step each time, as
    long as `most` allows; after_stop() is called after every stop."""
    for _ in range(most):
        run, errors = stop_after_first_step(command)
        if run.returncode == 0:
            return
        assert run.returncode == 143, errors
        after_stop()
    succeed(*command)


def run_measured(*arguments):
    """Runs the program and returns its exit status, all output and its peak memory in MiB."""
    with tempfile.TemporaryFile("w+") as output:
        run = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=output, stderr=output)
        _, status, usage = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        return run.returncode, output.read(), usage.ru_maxrss / 1024


def is_sanitized():
    """Returns true if the program runs under sanitizers, which use memory of their own."""
    return b"__asan_init" in read_bytes(PROGRAM) or b"__tsan_init" in read_bytes(PROGRAM)


def fresh_directory(name):
    """Returns an empty directory of this name in the scratch folder."""
    directory = os.path.join(SCRATCH, name)
    shutil.rmtree(directory, ignore_errors=True)
    os.makedirs(directory)
    return directory


def write_stack(path, views, pixel_size=PIXEL_SIZE):
    with mrcfile.new(path, overwrite=True) as file:
        file.set_data(np.asarray(views))
        file.set_image_stack()
        file.voxel_size = pixel_size


def read_volume(path):
    with mrcfile.open(path) as file:
        return file.data.astype(np.float64)


def distances_of_beads(volume, beads):
    """Returns how far the bright spots of a volume [z, y, x] are from where beads should be: their
    positions (x, y, z) count in voxels from its centre. A spot is the centre of mass of what is
    brighter than half of its peak, within 3 voxels of the place."""
    centre = (np.array(volume.shape[::-1]) - 1) / 2
    distances = []
    for bead in beads:
        place = centre + bead
        first = np.maximum(np.round(place).astype(int) - 3, 0)
        x, y, z = first
        box = volume[z:z + 7, y:y + 7, x:x + 7]
        weights = np.clip(box - (box.max() + np.median(box)) / 2, 0, None)
        spot = [(weights * index).sum() / weights.sum() for index in np.indices(box.shape)]
        distances.append(np.linalg.norm(first + spot[::-1] - place))
    return np.array(distances)


def read_bytes(path):
    with open(path, "rb") as file:
        return file.read()


def contents(folder):
    """Returns the bytes of every file in a folder and in those below."""
    return {os.path.join(path, name): read_bytes(os.path.join(path, name))
            for path, _, names in os.walk(folder) for name in names}


class Series:
    """Holds the views [tilt, y, x] of a simulated cell, which are wider than high, its truth
    [z, y, x], and the arguments that hand the series to reconstruct."""

    def __init__(self, name, seed=3):
        self.directory = fresh_directory(name)
        cell = os.path.join(self.directory, "cell")
        succeed("simulate", cell, "--size", WIDTH, "--thickness", THICKNESS, "--seed", seed,
                "--tilts=-60:60:6", "--noise", 0.03)
        rows = slice((WIDTH - HEIGHT) // 2, (WIDTH + HEIGHT) // 2)
        self.views = read_volume(os.path.join(cell, "tilt_series.mrc"))[:, rows]
        self.truth = read_volume(os.path.join(cell, "truth.mrc"))[:, rows]
        self.write("series", TILTS)

    def write(self, name, tilts):
        self.stack = os.path.join(self.directory, name + ".mrc")
        self.tlt = os.path.join(self.directory, name + ".tlt")
        write_stack(self.stack, self.views.astype(np.float32))
        np.savetxt(self.tlt, tilts, fmt="%.1f")
        self.input = [self.stack, "--tlt", self.tlt]

    def with_views(self, name, views, tilts=TILTS):
        """Returns the series with other images and tilts, in files of its own."""
        other = copy.copy(self)
        other.views = views
        other.write(name, tilts)
        return other

    def reconstruct(self, name, *options, run=succeed, **keywords):
        """Runs reconstruct with the QUICK options, which `options` replace, and returns its
        Results."""
        output = os.path.join(fresh_directory(name), "out.mrc")
        run("reconstruct", *self.input, "-o", output, *merge(QUICK, options), **keywords)
        return Results(output)


def merge(defaults, options):
    """Returns the defaults that `options` do not give again, and then the options."""
    given = {str(option).split("=")[0] for option in options if str(option).startswith("--")}
    kept = []
    for i, word in enumerate(defaults):
        owner = word if str(word).startswith("--") else defaults[i - 1]
        if owner not in given:
            kept.append(word)
    return [*kept, *options]


class Results:
    """Names and reads the files of a reconstruction."""

    def __init__(self, output):
        self.volume_path = output
        stem = output[: -len(".mrc")]
        self.model_path, self.json_path = stem + ".h5", stem + ".json"
        self.pictures = {plane: f"{stem}_{plane}.png" for plane in ("xy", "xz", "yz")}
        self.mask_picture = stem + "_mask.png"
        self.report_path = stem + "_report.html"
        self.all_paths = [output, self.model_path, self.json_path, self.mask_picture,
                          self.report_path, *self.pictures.values()]

    @property
    def volume(self):
        return read_volume(self.volume_path)

    def same_as(self, other):
        """Returns true if volume and model have the same bytes as another run's."""
        return (read_bytes(self.volume_path) == read_bytes(other.volume_path)
                and read_bytes(self.model_path) == read_bytes(other.model_path))

    def steps_done(self):
        """Returns the steps that the checkpoint has done; 0 without one."""
        try:
            with h5py.File(self.model_path) as model:
                return int(model["training/integers/step"][0])
        except OSError:
            return 0

    def leftovers(self):
        """Returns the files of the directory that are no results."""
        return set(glob.glob(os.path.join(glob.escape(os.path.dirname(self.volume_path)), "*"))
                   + glob.glob(os.path.join(glob.escape(os.path.dirname(self.volume_path)), ".*"))
                   ) - set(self.all_paths)


def fresh_results(name):
    """Names the results of a run in an empty directory of this name."""
    return Results(os.path.join(fresh_directory(name), "out.mrc"))


def views_of_bodies(tilts, width, height, low, high, number):
    """Returns views [tilt, y, x] of soft bodies with noise of standard deviation 1. The centres x, y
    and z of the bodies and their radii lie between `low` and `high`."""
    random = np.random.default_rng(1)
    bodies = random.uniform(low, high, size=(number, 4))
    y, x = np.mgrid[0:height, 0:width] + 0.5
    views = []
    for tilt in np.radians(tilts):
        view = random.normal(size=x.shape)
        for body_x, body_y, body_z, radius in bodies:
            at = width / 2 + body_x * np.cos(tilt) + body_z * np.sin(tilt)
            view += 3 * np.exp(-((x - at) ** 2 + (y - body_y) ** 2) / (2 * radius**2))
        views.append(view)
    return np.array(views)


def reconstruct_views(name, views, tilts, *options):
    """Reconstructs bare views in a directory of this name. Returns the program's run, the results,
    and their metrics."""
    results = fresh_results(name)
    stack, tlt = (results.volume_path.replace("out.mrc", end) for end in ("views.st", "views.tlt"))
    write_stack(stack, views.astype(np.float32))
    np.savetxt(tlt, tilts, fmt="%.1f")
    run = succeed("reconstruct", stack, "--tlt", tlt, "-o", results.volume_path, *options)
    with open(results.json_path) as file:
        return run, results, json.load(file)["metrics"]


def psnr(volume, truth):
    return -10 * np.log10(np.mean((volume - truth) ** 2))


def assert_same_tuning(one, other):
    """Checks that two tunings made the same trials with the same errors. Sums over all views may
    round differently."""
    assert one["predicted_views"] == other["predicted_views"] and one["chosen"] == other["chosen"]
    errors = [[t["held_out_error_by_view"] for t in tuning["trials"]] for tuning in (one, other)]
    np.testing.assert_allclose(*errors, rtol=1e-6)


def with_broken_views(source, every):
    """Returns the views that --hold-out EVERY scores, and the series with these views mirrored."""
    scored = list(range(every // 2, len(source.views) - 1, every))
    views = source.views.copy()
    views[scored] = views[scored, :, ::-1]
    return scored, source.with_views("broken", views)


def assert_scored_views_have_no_say(metrics, scored):
    """Checks the metrics of a series and of the same series with broken scored views. Both tunings
    are the same and did not use these views, and the broken views spoil the score."""
    assert_same_tuning(*(f["tuning"] for f in metrics))
    assert not set(metrics[0]["tuning"]["predicted_views"]) & set(scored)
    assert [view["view"] for view in metrics[0]["held_out"]["views"]] == scored
    assert metrics[1]["held_out"]["error"] > 2 * metrics[0]["held_out"]["error"]
