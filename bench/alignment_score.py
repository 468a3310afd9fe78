#!/usr/bin/python3
"""Scores an alignment against the truth of a series of `tomofield simulate --misalign`.

usage: alignment_score.py FOLDER ESTIMATE.xf [--tlt ESTIMATE.tlt] [--local ESTIMATE.json]

FOLDER is what simulate wrote. Prints one line of JSON:

  x_px, y_px        rms error of the views' shifts at the image's centre
  rotation_deg      rms error of the views' rotations; it contains axis_error_deg
  magnification     rms error of the logarithms of the views' magnifications
  axis_error_deg    mean error of the rotations: the error of the tilt axis
  tilt_offset_deg   mean error of the tilt angles (0 without --tlt)
  tilt_deg          rms error of the tilt angles after removal of the offset
  local_px          rms error of the local motion after removal of each view's affine part
  local_less_specimen_warp_px
                    the same after removal of what a fixed warp of the specimen explains

The last two appear if the truth or the estimate has local motion. ESTIMATE.json has it as phantom.json
has: views, each with local_px (docs/export-simulate.md). Errors go from the true to the estimated
aligned view. Removed is what only moves, turns or scales the specimen: shifts in x that are a
combination of cos(tilt) and sin(tilt), the mean shift in y, the mean logarithm of the magnifications,
and the tilt offset."""

import argparse
import json
import os
import sys

import numpy as np

PLACES = 16  # along each side of a view, at which alignments are compared


class Alignment:
    """Holds the transforms q = A p + shift, the tilts, and the local motion of each view."""

    def __init__(self, transforms, tilts_deg, local=None):
        transforms = np.atleast_2d(transforms)
        self.matrices = transforms[:, :4].reshape(-1, 2, 2)
        self.shifts = transforms[:, 4:]
        self.tilts_deg = np.atleast_1d(tilts_deg)
        self.local = local  # None or [view][row][column] = (x, y) in pixels

    def transforms(self):
        """Returns the lines of an .xf file, [view, 6]."""
        return np.hstack([self.matrices.reshape(-1, 4), self.shifts])

    def of_views(self, views):
        """Returns the alignment of some of the views."""
        return Alignment(self.transforms()[views], self.tilts_deg[views],
                         None if self.local is None else [self.local[view] for view in views])

    def displace(self, view, places, size):
        """Returns where the motion of a view puts places [n, 2] of the aligned view."""
        if self.local is None:
            return places
        nodes = np.asarray(self.local[view])
        across = node_weights(places[:, 0] / size, nodes.shape[1])
        along = node_weights(places[:, 1] / size, nodes.shape[0])
        return places + np.einsum("nr,nc,rcd->nd", along, across, nodes)


def node_weights(position, count):
    """Returns the weights [n, count] of the nodes of a side at positions from -1/2 to 1/2.

    Between nodes it is a cubic Hermite spline with central differences for slopes, at the ends
    one-sided ones."""
    at = np.clip((position + 0.5) * (count - 1), 0, count - 1)
    cell = np.minimum(at.astype(int), count - 2)
    f = (at - cell)[:, None]
    values, slopes = np.eye(count), np.gradient(np.eye(count), axis=0)
    return ((1 + 2 * f) * (1 - f)**2 * values[cell] + f**2 * (3 - 2 * f) * values[cell + 1] +
            f * (1 - f)**2 * slopes[cell] + f**2 * (f - 1) * slopes[cell + 1])


def grid(size):
    """Returns places [n, 2] that cover a view evenly, relative to its centre."""
    line = ((np.arange(PLACES) + 0.5) / PLACES - 0.5) * size
    x, y = np.meshgrid(line, line)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def errors(truth, estimate, size):
    """Returns the error [view, n, 2] of the estimated place of what truly is at places of a view."""
    places, found = grid(size), []
    for view, (true, matrix) in enumerate(zip(truth.matrices, estimate.matrices)):
        recorded = np.linalg.solve(true, (places - truth.shifts[view]).T).T
        estimated = recorded @ matrix.T + estimate.shifts[view]
        found.append(estimate.displace(view, estimated, size) - truth.displace(view, places, size))
    return np.array(found)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def residual(values, basis):
    """Returns values [n, …] less their least-squares fit by the columns of basis [n, k]."""
    return values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]


def specimen_warp_residual(local, tilts_deg, size):
    """Returns errors [view, n, 2] less those of a warp of the specimen that all views share.

    The warp has 5 x 5 nodes over the specimen's plane. The point X, Y in it is seen at
    x = X cos(tilt), y = Y, and its displacement is seen like a point of the specimen."""
    places = grid(size)
    affine = np.column_stack([np.ones(len(places)), places])
    tilts = np.radians(tilts_deg)
    weights = [residual((node_weights(places[:, 1] / size, 5)[:, :, None] *
                         node_weights(places[:, 0] / np.cos(tilt) / size, 5)[:, None, :]
                         ).reshape(len(places), 25), affine) for tilt in tilts]
    across = np.concatenate([np.hstack([w * np.cos(tilt), w * np.sin(tilt)])
                             for w, tilt in zip(weights, tilts)])
    flat = local.reshape(-1, 2)
    return np.stack([residual(flat[:, 0], across), residual(flat[:, 1], np.concatenate(weights))],
                    axis=1).reshape(local.shape)


def specimen_shift(shifts, tilts_deg):
    """Returns the part of the views' shifts [view, 2] that a shift of the specimen explains."""
    tilts = np.radians(tilts_deg)
    x = shifts[:, 0] - residual(shifts[:, 0], np.column_stack([np.cos(tilts), np.sin(tilts)]))
    return np.column_stack([x, np.full(len(x), shifts[:, 1].mean())])


class Differences:
    """Holds how an estimate differs from the truth, without removing anything: for each view the
    shift, the rotation, the logarithm of the magnification, the tilt angle, and the rest of the
    motion at the places of grid() [view, n, 2]."""

    def __init__(self, truth, estimate, size):
        places = grid(size)
        affine = np.column_stack([np.ones(len(places)), places])
        found = errors(truth, estimate, size)
        fits = np.array([np.linalg.lstsq(affine, error, rcond=None)[0] for error in found])
        maps = np.eye(2) + fits[:, 1:].swapaxes(1, 2)
        self.shifts_px = fits[:, 0]
        self.rotations_deg = np.degrees(np.arctan2(maps[:, 1, 0] - maps[:, 0, 1],
                                                   maps[:, 0, 0] + maps[:, 1, 1]))
        self.log_magnifications = np.log(np.linalg.det(maps)) / 2
        self.tilts_deg = estimate.tilts_deg - truth.tilts_deg
        self.local_px = found - affine @ fits


def less_specimen_warp(estimate, found, size):
    """Returns the local motion of the estimate less the specimen's warp that explains most of its
    differences `found`."""
    if estimate.local is None:
        return None
    warp = found.local_px - specimen_warp_residual(found.local_px, estimate.tilts_deg, size)
    across, along = (node_weights(grid(size)[:, axis] / size, 5) for axis in (0, 1))
    weights = (along[:, :, None] * across[:, None, :]).reshape(-1, 25)
    return [np.asarray(nodes) - np.linalg.lstsq(weights, of_view, rcond=None)[0].reshape(5, 5, 2)
            for nodes, of_view in zip(estimate.local, warp)]


def in_frame_of(truth, estimate, size):
    """Returns the estimate with its specimen moved, scaled, tilted and bent to where the truth has
    it."""
    found = Differences(truth, estimate, size)
    scale = np.exp(-found.log_magnifications.mean())
    shifts = estimate.shifts - specimen_shift(found.shifts_px, truth.tilts_deg)
    return Alignment(scale * np.hstack([estimate.matrices.reshape(-1, 4), shifts]),
                     estimate.tilts_deg - found.tilts_deg.mean(),
                     less_specimen_warp(estimate, found, size))


def score(truth, estimate, size):
    """Returns the figures of the module's text for views of size x size pixels."""
    found = Differences(truth, estimate, size)
    shifts = found.shifts_px - specimen_shift(found.shifts_px, truth.tilts_deg)
    figures = {
        "x_px": rms(shifts[:, 0]),
        "y_px": rms(shifts[:, 1]),
        "rotation_deg": rms(found.rotations_deg),
        "magnification": rms(found.log_magnifications - found.log_magnifications.mean()),
        "axis_error_deg": float(found.rotations_deg.mean()),
        "tilt_offset_deg": float(found.tilts_deg.mean()),
        "tilt_deg": rms(found.tilts_deg - found.tilts_deg.mean()),
    }
    if truth.local is not None or estimate.local is not None:
        warp_free = specimen_warp_residual(found.local_px, truth.tilts_deg, size)
        figures["local_px"] = rms(np.linalg.norm(found.local_px, axis=2))
        figures["local_less_specimen_warp_px"] = rms(np.linalg.norm(warp_free, axis=2))
    return figures


def read_local(path):
    """Returns the local motion of a JSON file's views, or None if they have none."""
    with open(path, encoding="utf-8") as file:
        views = json.load(file)["views"]
    if not any("local_px" in view for view in views):
        return None
    none = np.zeros((5, 5, 2)).tolist()  # of views that were left out
    return [view.get("local_px", none) for view in views]


def read_truth(folder):
    """Returns the Alignment of a series of simulate, and the width of its views in pixels."""
    record, xf, tlt = (os.path.join(folder, name)
                       for name in ("phantom.json", "tilt_series.xf", "tilt_series.tlt"))
    with open(record, encoding="utf-8") as file:
        size = json.load(file)["options"]["size_px"]
    tilts = np.loadtxt(tlt, ndmin=1)
    true = np.loadtxt(xf, ndmin=2) if os.path.exists(xf) else unaligned(len(tilts))
    return Alignment(true, tilts, read_local(record)), size


def unaligned(count):
    """Returns lines of an .xf file that change nothing."""
    return np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.0], (count, 1))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("xf")
    parser.add_argument("--tlt")
    parser.add_argument("--local")
    arguments = parser.parse_args()
    truth, size = read_truth(arguments.folder)
    tilts = truth.tilts_deg
    estimate = Alignment(np.loadtxt(arguments.xf, ndmin=2),
                         np.loadtxt(arguments.tlt, ndmin=1) if arguments.tlt else tilts,
                         read_local(arguments.local) if arguments.local else None)
    counts = [len(estimate.matrices), len(estimate.tilts_deg), len(estimate.local or tilts)]
    if set(counts) != {len(tilts)}:
        sys.exit(f"{arguments.xf}: the series has {len(tilts)} views, but the estimate has "
                 f"{counts[0]} transforms, {counts[1]} tilts and {counts[2]} views with motion")
    print(json.dumps(score(truth, estimate, size)))


if __name__ == "__main__":
    main()
