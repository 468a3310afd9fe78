"""Runs and keeps the rows of a quality benchmark.

A row is one way to reconstruct. The bench runs it on one yardstick phantom (docs/index.md) with one
seed, scores it against the truth and keeps it as one JSON file. A bench that was interrupted goes
on with the next row. The seeds differ from those of the tests."""

import collections
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time

SEEDS = (101, 102, 103)
HERE = os.path.dirname(os.path.abspath(__file__))
PROJECT = os.path.dirname(HERE)


def add_folder_arguments(parser):
    """Adds the options that every bench of rows has."""
    parser.add_argument("out", help="folder for phantoms and rows; a second run adds what is missing")
    parser.add_argument("--program", default=os.path.join(PROJECT, "build/release/tomofield"))
    parser.add_argument("--only", default="", help="rows whose name matches this expression")
    parser.add_argument("--table", action="store_true", help="run nothing; print the table")


def add_arguments(parser):
    add_folder_arguments(parser)
    parser.add_argument("--size", type=int, default=128, help="thickness is 75/128 of it")
    parser.add_argument("--seeds", default=",".join(map(str, SEEDS)))


def thickness_of(size):
    """Returns the thickness of a yardstick of this size."""
    return round(size * 75 / 128)


def phantom(options, kind, size, noise, seed, thickness=None):
    """Returns the folder of a phantom and makes it with `tomofield simulate` if it is absent.

    A phantom of kind A ends in the field of view, one of kind B does not. The thickness is the
    yardstick's unless it is given."""
    thickness = thickness or thickness_of(size)
    shape = f"{size}" if thickness == thickness_of(size) else f"{size}x{thickness}"
    folder = os.path.join(options.out, "phantoms", f"{kind}{shape}_{noise}_{seed}")
    simulate(options, folder, "--yardstick", kind.lower(), "--size", size, "--thickness", thickness,
             "--noise", noise, "--seed", seed)
    return folder


def simulate(options, folder, *arguments):
    """Simulates a series into a folder that has no complete one yet."""
    if not os.path.exists(os.path.join(folder, "phantom.json")):  # simulate writes it last
        subprocess.run([options.program, "simulate", folder, *map(str, arguments), "--overwrite"],
                       check=True, stdout=subprocess.DEVNULL)


def series_arguments(folder, thickness, tlt=None):
    """Returns the arguments that describe the series in a folder of simulate() to tomofield. `tlt`
    names other tilt angles."""
    return [os.path.join(folder, "tilt_series.mrc"), "--tlt",
            tlt or os.path.join(folder, "tilt_series.tlt"), "--thickness", str(thickness),
            "--contrast", "bright"]


Usage = collections.namedtuple("Usage", "core_seconds peak_MiB wall_seconds")


def run_measured(command, **keywords):
    """Runs a command and returns its Usage, which includes the processes that it started."""
    start = time.monotonic()
    with tempfile.TemporaryFile("w+") as errors:
        run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors, **keywords)
        _, status, usage = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
        if run.returncode != 0:
            errors.seek(0)
            sys.exit(f"{' '.join(command)}\n{errors.read()}")
    return Usage(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, time.monotonic() - start)


def dry_run(command):
    """Returns the memory in MiB and, for a fit, the steps that --dry-run predicts for a command.

    The program rounds the memory to 0.01 GiB, or to 0.1 GiB where the machine has less and the
    command fails."""
    done = subprocess.run([*command, "--dry-run"], capture_output=True, text=True)
    said = done.stdout + done.stderr
    memory, steps = re.search(r"about ([\d.]+) GiB\s+of memory", said), re.search(r"(\d+) steps", said)
    if not memory:
        sys.exit(f"{' '.join(command)} --dry-run\n{done.stderr}{done.stdout}")
    return {"MiB": 1024 * float(memory.group(1)), **({"steps": int(steps.group(1))} if steps else {})}


def measure(options, arguments, kind, noise, seed, scratch):
    """Runs `tomofield ARGUMENTS…` on the phantom, scores the volume and returns the row."""
    folder = phantom(options, kind, options.size, noise, seed)
    volume = os.path.join(scratch, "volume.mrc")
    command = [options.program, *arguments.split(),
               *series_arguments(folder, thickness_of(options.size)), "-o", volume, "--overwrite"]
    command += ["--no-margin"] if kind == "A" else []
    row = {"arguments": arguments, "kind": kind, "noise": noise, "seed": seed, "size": options.size}
    usage = run_measured(command)
    row["core_seconds"], row["peak_MiB"] = usage.core_seconds, usage.peak_MiB
    truth = os.path.join(folder, "truth.mrc")
    row["scores"] = score(options, volume, truth, scratch)
    with open(os.path.splitext(volume)[0] + ".json") as file:
        figures = json.load(file)["metrics"]
    row.update({key: figures[key] for key in ("parameters", "leaves") if key in figures})
    if "compact" in figures:
        row["parameters"] = figures["compact"]["parameters"]
    model = os.path.splitext(volume)[0] + ".h5"
    if os.path.exists(model):
        if arguments.startswith("reconstruct") and row["leaves"] > 1:  # else there are no faces
            row["seam"] = script_json("seam.py", volume, "--truth", truth)["over_truth"]
        row["streaks"] = (script_json("axis_streaks.py", volume)["ratio"]
                          / script_json("axis_streaks.py", truth)["ratio"])
        os.remove(model)
    return row


def score(options, volume, truth, scratch):
    """Returns the scores that `tomofield evaluate` gives a volume."""
    scores = os.path.join(scratch, "scores.json")
    run_measured([options.program, "evaluate", volume, truth, "--json", scores, "--overwrite"])
    with open(scores) as file:
        return json.load(file)


def script_json(script, *arguments):
    done = subprocess.run(["/usr/bin/python3", os.path.join(HERE, script), *arguments], check=True,
                          capture_output=True, text=True)
    return json.loads(done.stdout)


def has_row(path, arguments):
    """Returns true if the row exists and was made with the same arguments."""
    if not os.path.exists(path):
        return False
    with open(path) as file:
        return json.load(file)["arguments"] == arguments


class Rows:
    """Keeps the rows of a bench. A `with` statement gives it a scratch folder to measure in."""

    def __init__(self, options, bench):
        self.options = options
        self.folder = os.path.join(options.out, bench)
        self.scratch = os.path.join(self.folder, f"scratch-{os.getpid()}")

    def __enter__(self):
        os.makedirs(self.scratch, exist_ok=True)
        return self

    def __exit__(self, *_):
        subprocess.run(["rm", "-rf", self.scratch], check=True)

    def kept(self, name, arguments, make, may_make=True):
        """Returns the row of this name and these arguments.

        A missing row is made by make(scratch folder). The result is None if the row is missing and
        must not be made."""
        path = os.path.join(self.folder, re.sub(r"[^\w.+-]+", "_", name) + ".json")
        if not has_row(path, arguments):
            if self.options.table or not may_make:
                return None
            row = {**make(self.scratch), "arguments": arguments}
            with open(path + ".part", "w") as file:
                json.dump(row, file, indent=1)
            os.rename(path + ".part", path)
        with open(path) as file:
            return json.load(file)

    def row(self, name, arguments, kind, noise, seed):
        """Returns the row of this name and seed and measures it if it is missing. With --table
        it returns None instead."""

        def make(scratch):
            row = measure(self.options, arguments, kind, noise, seed, scratch)
            print(f"{name} seed {seed}: {psnr(row):.2f} dB, {row['core_seconds']:.0f} core-s",
                  file=sys.stderr, flush=True)
            return row

        return self.kept(f"{name}_{self.options.size}_{seed}", arguments, make)


def run_rows(options, bench, rows):
    """Measures rows, {name: (arguments, kind, noise)}, and returns {name: [row of each seed]}."""
    results = {}
    with Rows(options, bench) as measured:
        for name, (arguments, kind, noise) in rows.items():
            if not re.search(options.only, name):
                continue
            for seed in options.seeds.split(","):
                row = measured.row(name, arguments, kind, noise, int(seed))
                if row:
                    results.setdefault(name, []).append(row)
    return results


def psnr(row):
    return row["scores"]["psnr_raw_dB"]


def ssim(row):
    return row["scores"]["ssim_raw"]


def mean_and_spread(values, digits=2):
    if len(values) == 1:
        return f"{values[0]:.{digits}f}"
    return f"{statistics.mean(values):.{digits}f} ± {statistics.stdev(values):.{digits}f}"


def print_table(results):
    print("| row | PSNR, dB | after scale and offset | SSIM | speckle, % | parameters | core-s "
          "| seam / truth's | streaks / truth's |")
    print("|-|-|-|-|-|-|-|-|-|")
    for name, rows in results.items():
        cells = [name, mean_and_spread([psnr(r) for r in rows]),
                 mean_and_spread([r["scores"]["psnr_affine_dB"] for r in rows]),
                 mean_and_spread([ssim(r) for r in rows], 3),
                 mean_and_spread([100 * (r["scores"]["speckle"] or 0) for r in rows], 3),
                 f"{rows[0].get('parameters', 0) / 1e6:.2f} M",
                 f"{statistics.median(r['core_seconds'] for r in rows):.0f}"]
        for key in ("seam", "streaks"):
            cells.append(mean_and_spread([r[key] for r in rows])
                         if key in rows[0] else "")
        print("| " + " | ".join(cells) + " |")
