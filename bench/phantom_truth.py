"""Computes the density of a phantom of hollow ellipsoids in a box, from the phantom.json that
`tomofield simulate` writes. The whole truth of a wide phantom would fill a disk."""

import json

import numpy as np


class PhantomTruth:
    """Holds the ellipsoids of an extended phantom without beads. `shape` is that of its tomogram,
    (z, y, x)."""

    def __init__(self, path, shape):
        with open(path, encoding="utf-8") as file:
            record = json.load(file)
        self.shape = shape
        self.slab_density = record["slab_density"]
        self.ellipsoids = record["ellipsoids"]

    def box(self, low, high):
        """Returns the densities at the centres of voxels low ≤ (z, y, x) < high."""
        axes = [np.arange(a, b) + 0.5 - size / 2 for a, b, size in zip(low, high, self.shape)]
        densities = np.full([len(axis) for axis in axes], self.slab_density)
        for ellipsoid in self.ellipsoids:
            add_ellipsoid(densities, axes, ellipsoid)
        return densities.astype(np.float32)


def add_ellipsoid(densities, axes, ellipsoid):
    """Adds an ellipsoid where its bounding sphere meets the box."""
    centre = ellipsoid["center_px"][::-1]  # z, y, x
    near = [np.flatnonzero(np.abs(axis - at) <= ellipsoid["radius_px"])
            for axis, at in zip(axes, centre)]
    if not all(len(places) for places in near):
        return
    part = tuple(slice(places[0], places[-1] + 1) for places in near)
    z, y, x = np.ix_(*(axis[places] - at for axis, places, at in zip(axes, part, centre)))
    q = np.array(ellipsoid["q"])
    form = (q[0, 0] * x * x + q[1, 1] * y * y + q[2, 2] * z * z
            + 2 * (q[0, 1] * x * y + q[0, 2] * x * z + q[1, 2] * y * z))
    inner = form < ellipsoid["inner_to_outer_ratio"]**2
    densities[part] += np.where(inner, ellipsoid["inside_density"],
                                np.where(form < 1, ellipsoid["wall_density"], 0.0))
