"""Tests that beads come out of reconstruct where they went into the tilt series.

A lopsided pair of Gaussian beads far from every centre, whose projections are
analytic, is written with mrcfile, reconstructed by the program and looked for
in the output file's own axes, for every option that moves or turns the volume."""

import os

import mrcfile
import numpy as np

import harness

TOLERANCE = 0.2  # voxels of the output
WIDTH, HEIGHT, THICKNESS = 70, 58, 40  # pixels of the view, of the slab
TILTS = np.arange(-60, 61, 4.0)
NOISE = 0.1  # of a line integral; the bead's largest are about 7

# (X, Y, Z), sigma and peak density, in pixels; pixel i covers [i, i + 1).
BEAD = [((43.3, 20.6, 13.2), 2.2, 1.0), ((46.9, 18.2, 16.4), 1.5, 1.0)]
FAR_BEAD = [((14.0, 45.0, 28.0), 2.2, 1.0)]


def true_volume(gaussians):
    """Returns the densities [z, y, x] at voxel centres."""
    z, y, x = np.indices((THICKNESS, HEIGHT, WIDTH)) + 0.5
    return sum(density * np.exp(-((x - X)**2 + (y - Y)**2 + (z - Z)**2) / (2 * sigma**2))
               for (X, Y, Z), sigma, density in gaussians)


def project(gaussians, hand=1, center=(WIDTH / 2, THICKNESS / 2)):
    """Returns the views [tilt, y, x]: x − cx = (X − cx) cos + hand (Z − cz) sin, y = Y."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    views = np.random.default_rng(1).normal(0, NOISE, (len(TILTS), HEIGHT, WIDTH))
    for view, tilt in zip(views, np.deg2rad(TILTS)):
        for (X, Y, Z), sigma, density in gaussians:
            u = center[0] + (X - center[0]) * np.cos(tilt) + hand * (Z - center[1]) * np.sin(tilt)
            r2 = (x - u) ** 2 + (y - Y) ** 2
            view += density * sigma * np.sqrt(2 * np.pi) * np.exp(-r2 / (2 * sigma**2))
    return views.astype(np.float32)


def reconstruct(name, views, *options, epochs=8):
    """Returns the volume [section, row, column] as the file has it."""
    directory = harness.fresh_directory(name)
    stack, tlt = os.path.join(directory, "series.mrc"), os.path.join(directory, "series.tlt")
    with mrcfile.new(stack) as file:
        file.set_data(views)
        file.voxel_size = 5.0
    np.savetxt(tlt, TILTS, fmt="%.2f")
    output = os.path.join(directory, "out.mrc")
    harness.succeed("reconstruct", stack, "--tlt", tlt, "-o", output, "--contrast", "bright",
                    "--thickness", THICKNESS, "--epochs", epochs, "--rank", 6, *options)
    with mrcfile.open(output) as file:
        return file.data.astype(np.float64)


def find_bead(volume):
    """Returns the centre of mass (column, row, section) of voxels above a fifth of the peak."""
    weights = np.where(volume > 0.2 * volume.max(), volume, 0)
    total = weights.sum()
    sections, rows, columns = np.indices(volume.shape) + 0.5
    return np.array([(weights * axis).sum() / total for axis in (columns, rows, sections)])


def check(name, volume, shape, expected):
    assert volume.shape == shape, f"{name}: shape {volume.shape} instead of {shape}"
    found = find_bead(volume)
    off = np.abs(found - expected)
    print(f"{name}: found {found.round(3)}, expected {np.round(expected, 3)}, off {off.max():.3f}")
    assert off.max() < TOLERANCE, f"{name}: off by {off}"


PLACE = find_bead(true_volume(BEAD))
WHOLE = (THICKNESS, HEIGHT, WIDTH)


def test_every_field_finds_the_bead():
    plain = project(BEAD)
    check("default", reconstruct("default", plain, "--no-margin"), WHOLE, PLACE)
    check("grid", reconstruct("grid", plain, "--no-margin", "--field", "grid", epochs=16), WHOLE,
          PLACE)
    check("margin", reconstruct("margin", plain), WHOLE, PLACE)


def test_the_wrong_hand_mirrors_the_volume_in_z():
    X, Y, Z = PLACE
    mirrored = project(BEAD, hand=-1)
    check("hand -1", reconstruct("hand", mirrored, "--no-margin", "--hand", -1), WHOLE, (X, Y, Z))
    check("wrong hand", reconstruct("wrong_hand", mirrored, "--no-margin"), WHOLE,
          (X, Y, THICKNESS - Z))


def test_the_tilt_axis_lies_where_center_says():
    shifted = project(BEAD, center=(31.7, 23.5))
    check("center x,z", reconstruct("center", shifted, "--no-margin", "--center", "31.7,23.5"),
          WHOLE, PLACE)
    shifted = project(BEAD, center=(31.7, THICKNESS / 2))
    check("center x", reconstruct("center_x", shifted, "--no-margin", "--center", "31.7",
                                  "--axes", "xyz"), WHOLE, PLACE)


def test_axes_of_imod():
    X, Y, Z = PLACE
    # IMOD's order is (X, thickness, Y): trimvol -rx makes Z = thickness - 1 - row of it.
    check("axes xzy", reconstruct("xzy", project(BEAD), "--no-margin", "--axes", "xzy"),
          (HEIGHT, THICKNESS, WIDTH), (X, THICKNESS - Z, Y))


def test_a_region_of_interest():
    X, Y, Z = PLACE
    # The margin has to take a bead that lies outside the region.
    both = project(BEAD + FAR_BEAD)
    check("roi", reconstruct("roi", both, "--roi", "27,5,66,38"), (THICKNESS, 33, 39),
          (X - 27, Y - 5, Z))


def test_binned_views():
    check("bin 2", reconstruct("bin", project(BEAD), "--no-margin", "--bin", 2),
          (THICKNESS // 2, HEIGHT // 2, WIDTH // 2), PLACE / 2)


def test_all_of_it_together():
    X, Y, Z = PLACE
    check("bin 2, roi, center, hand -1, xzy",
          reconstruct("all", project(BEAD + FAR_BEAD, hand=-1, center=(31.7, 23.5)), "--bin", 2,
                      "--roi", "28,6,66,38", "--center", "31.7,23.5", "--hand", -1, "--axes", "xzy"),
          (16, THICKNESS // 2, 19), ((X - 28) / 2, (THICKNESS - Z) / 2, (Y - 6) / 2))
