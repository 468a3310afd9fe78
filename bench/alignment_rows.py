"""Lists the rows of bench/alignment and measures them."""

import dataclasses
import json
import os
import re
import subprocess

import numpy as np

import alignment_score
import quality_rows
from alignment_score import Alignment

PUBLISHED = ("xcorr", "matching")  # methods of published_alignment.py
QUICK_FIT = "--tv-penalty smooth --coarse-epochs 1 --vertex-epochs 1 --epochs 1 --rank 4"


@dataclasses.dataclass(frozen=True)
class Case:
    """Describes a misaligned series, how it is aligned, and what is asked: {figure: limit}."""

    name: str
    align: str  # refine or full, or a method of published_alignment.py
    moved: str  # options of simulate that its .xf file undoes
    asked: dict
    warped: str = ""  # options of simulate that no .xf file undoes
    tilt_offset_deg: float = 0.0  # error of the given tilt angles
    tilt_spread_deg: float = 0.0  # of the random errors of the given tilt angles
    noise: float = 0.05


def cases(kind):
    """Returns the cases of a yardstick."""
    moved_3 = "--misalign 3 --misalign-rotation 0.3 --misalign-magnification 0.2"
    moved_10 = moved_3.replace("--misalign 3", "--misalign 10")
    nearest_px = 0.05 if kind == "A" else 0.12
    nearest = {"x_px": nearest_px, "y_px": nearest_px, "rotation_deg": 0.02, "loss_dB": 0.15}
    roughly = {"x_px": 0.3, "y_px": 0.3}
    return (
        Case("3 px", "refine", moved_3, nearest),
        Case("3 px, noise 0.12", "refine", moved_3, roughly, noise=0.12),
        Case("10 px", "full", moved_10, roughly),
        Case("3 px, axis 3°", "full", f"{moved_3} --misalign-axis 3", {"axis_error_deg": 0.05}),
        # Noise is a part of the range, which gold makes five times as large.
        Case("3 px, 12 beads", "refine", f"{moved_3} --gold 12", nearest, noise=0.01),
        Case("3 px, tilt offset 2°", "refine", moved_3, {"tilt_offset_deg": 0.2}, tilt_offset_deg=2),
        Case("3 px, tilts 0.3°", "refine", moved_3, {}, tilt_spread_deg=0.3),
        Case("3 px", "xcorr", moved_3, {}),
        Case("3 px", "matching", moved_3, {}),
        Case("warp 2 px", "refine", "", {"warp_left": 0.2, "loss_dB": 0.4},
             warped="--misalign-local 2"),
        Case("aligned", "refine", "", {"x_px": 0.05, "y_px": 0.05}),
    )


@dataclasses.dataclass(frozen=True)
class Row:
    """Describes a case on a yardstick."""

    kind: str
    case: Case
    size: int
    fit: str  # options of every reconstruction

    @property
    def name(self):
        return f"{self.kind} {self.case.name} {self.case.align}"

    @property
    def arguments(self):
        """Returns what has changed if a row must be measured again."""
        case = self.case
        return (f"noise {case.noise} {case.moved} {case.warped} tilt offset {case.tilt_offset_deg} "
                f"spread {case.tilt_spread_deg} {case.align} {self.fit}")


def all_rows(size, fit=""):
    return [Row(kind, case, size, fit) for kind in "AB" for case in cases(kind)]


def series(options, row, seed, misalignment):
    """Returns the folder of a series and makes it with `tomofield simulate` if it is absent."""
    name = f"{row.kind}{row.size}_{row.case.noise}_{seed} {misalignment}".strip()
    folder = os.path.join(options.out, "phantoms", re.sub(r"[^\w.]+", "_", name))
    quality_rows.simulate(options, folder, "--yardstick", row.kind.lower(), "--size", row.size,
                          "--noise", row.case.noise, "--seed", seed, *misalignment.split())
    return folder


def reconstruct(options, row, volume, folder, *arguments, tlt=None):
    """Reconstructs the series in a folder and returns the core-seconds."""
    command = [options.program, "reconstruct", *row.fit.split(), *arguments, "-o", volume]
    command += quality_rows.series_arguments(folder, quality_rows.thickness_of(row.size), tlt)
    command += ["--no-margin"] if row.kind == "A" else []
    return quality_rows.run_measured(command).core_seconds


def read_estimate(prefix):
    """Returns the Alignment in PREFIX.xf, .tlt and .json, and the views that were not left out."""
    with open(f"{prefix}.json", encoding="utf-8") as file:
        views = json.load(file)["views"]
    kept = [number for number, view in enumerate(views) if not view["left_out"]]
    return Alignment(np.loadtxt(f"{prefix}.xf"), np.loadtxt(f"{prefix}.tlt"),
                     alignment_score.read_local(f"{prefix}.json")), kept


def write_in_frame(truth, estimate, kept, size, prefix):
    """Writes the estimate, moved to where the truth has the specimen, as PREFIX.xf and PREFIX.tlt.
    Returns the arguments of tomofield that leave out the views that were not kept."""
    moved = alignment_score.in_frame_of(truth.of_views(kept), estimate.of_views(kept), size)
    lines, tilts = truth.transforms(), truth.tilts_deg.copy()
    lines[kept], tilts[kept] = moved.transforms(), moved.tilts_deg
    np.savetxt(f"{prefix}.xf", lines, fmt="%.9f")
    np.savetxt(f"{prefix}.tlt", tilts, fmt="%.6f")
    left_out = sorted(set(range(len(tilts))) - set(kept))
    return ["--exclude", ",".join(str(view + 1) for view in left_out)] if left_out else []


def write_record_in_frame(truth, estimate, size, source, target):
    """Writes the record of an alignment of a series without an .xf file, moved to where the truth has
    the specimen, for a run that resumes from it. An .xf file has no local motion."""
    moved = alignment_score.in_frame_of(truth, estimate, size)
    with open(source, encoding="utf-8") as file:
        record = json.load(file)
    for view, matrix, shift, local in zip(record["views"], moved.matrices, moved.shifts, moved.local):
        inverse = np.linalg.inv(matrix)
        view.update(
            shift_px=list(-inverse @ shift),
            rotation_deg=float(np.degrees(np.arctan2(inverse[1, 0] - inverse[0, 1],
                                                     inverse[0, 0] + inverse[1, 1]))),
            log_magnification=float(np.log(np.linalg.det(inverse)) / 2), local_px=local.tolist())
    with open(target, "w", encoding="utf-8") as file:
        json.dump(record, file)


def align_as_published(row, folder, prefix):
    """Aligns the series in a folder with published_alignment.py and writes PREFIX.xf, .tlt, .json."""
    program = os.path.join(os.path.dirname(os.path.abspath(__file__)), "published_alignment.py")
    subprocess.run([program, folder, str(quality_rows.thickness_of(row.size)), row.case.align,
                    f"{prefix}.xf"], check=True)
    tilts = np.loadtxt(os.path.join(folder, "tilt_series.tlt"))
    np.savetxt(f"{prefix}.tlt", tilts, fmt="%.6f")
    with open(f"{prefix}.json", "w", encoding="utf-8") as file:
        json.dump({"views": [{"left_out": False} for _ in tilts]}, file)


def psnr(options, volume, folder, scratch):
    truth = os.path.join(folder, "truth.mrc")
    return quality_rows.score(options, volume, truth, scratch)["psnr_affine_dB"]


def measure(options, row, seed, scratch):
    """Reconstructs a series with its true alignment, with the one that tomofield finds, and with
    that one moved to where the truth has the specimen. Returns the figures."""
    case = row.case
    wrong_tilts = f"--misalign-tilt {case.tilt_spread_deg}" if case.tilt_spread_deg else ""
    folder = series(options, row, seed, f"{case.moved} {case.warped} {wrong_tilts}")
    given_tlt = os.path.join(folder, "tilt_series.rawtlt") if wrong_tilts else None
    unwarped = series(options, row, seed, case.moved)
    best, aligned, moved = (os.path.join(scratch, name) for name in ("best", "aligned", "moved"))
    true_xf = os.path.join(unwarped, "tilt_series.xf")  # simulate wrote none for an aligned series
    seconds_without = reconstruct(options, row, f"{best}.mrc", unwarped,
                                  *(["--xf", true_xf] if os.path.exists(true_xf) else []))
    aligning = ["--align", case.align, "--tilt-offset", str(case.tilt_offset_deg)]
    if case.align in PUBLISHED:
        seconds = None
        align_as_published(row, folder, f"{aligned}_align")
    else:
        seconds = reconstruct(options, row, f"{aligned}.mrc", folder, *aligning, tlt=given_tlt)

    truth, size = alignment_score.read_truth(folder)
    estimate, kept = read_estimate(f"{aligned}_align")
    if estimate.local is None:
        exclude = write_in_frame(truth, estimate, kept, size, moved)
        reconstruct(options, row, f"{moved}.mrc", folder, "--xf", f"{moved}.xf", *exclude,
                    tlt=f"{moved}.tlt")
    else:
        write_record_in_frame(truth, estimate, size, f"{aligned}_align.json", f"{moved}_align.json")
        reconstruct(options, row, f"{moved}.mrc", folder, *aligning, "--resume")

    given = Alignment(alignment_score.unaligned(len(truth.tilts_deg)),
                      (np.loadtxt(given_tlt) if given_tlt else truth.tilts_deg)
                      + case.tilt_offset_deg)
    start = alignment_score.score(truth, given, size)
    found = alignment_score.score(truth.of_views(kept), estimate.of_views(kept), size)
    if case.warped:
        found["warp_left"] = (found["local_less_specimen_warp_px"]
                              / start["local_less_specimen_warp_px"])
    best_dB = psnr(options, f"{best}.mrc", unwarped, scratch)
    found["loss_dB"] = best_dB - psnr(options, f"{moved}.mrc", folder, scratch)
    if seconds is not None:
        found["cost"] = seconds / seconds_without
    return {"start": start, "found": found, "psnr_true_dB": best_dB,
            "core_seconds": {"without": seconds_without, "with": seconds},
            "left_out": len(truth.tilts_deg) - len(kept)}
