"""Tests reconstruct --engine ray on raw views with in-plane rotation, shifts and x-axis tilt.

Gaussian beads, whose projections are analytic in any geometry, are written as the views that a
microscope would record, with the alignment in IMOD's or AreTomo's files, and looked for in the
volume: nothing here shares code with tomofield's geometry."""

import os
import signal

import numpy as np
import pytest

import harness
from harness import read_bytes, succeed, tomofield

WIDTH, HEIGHT, THICKNESS = 48, 40, 24  # of the aligned view and the slab
TILTS = np.arange(-60, 61, 4.0)
NOISE = 0.05  # of a line integral; the largest are about 6

# (X, Y, Z), sigma and peak density; no axis mirrors them.
BEADS = [((30.3, 14.6, 8.2), 2.2, 1.0), ((33.9, 12.2, 11.4), 1.5, 1.0),
         ((14.0, 29.0, 16.5), 2.0, 0.7), ((22.5, 21.0, 5.0), 1.6, 0.9),
         ((36.0, 30.5, 17.0), 1.8, 0.8)]


def rotation(axis, degrees):
    """Returns the right-handed rotation of column vectors."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return {"x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
            "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
            "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])}[axis]


def truth():
    """Returns the densities [z, y, x] at voxel centres."""
    z, y, x = np.indices((THICKNESS, HEIGHT, WIDTH)) + 0.5
    return sum(density * np.exp(-((x - X)**2 + (y - Y)**2 + (z - Z)**2) / (2 * sigma**2))
               for (X, Y, Z), sigma, density in BEADS)


class RawSeries:
    """Holds recorded views: p_raw − c_raw = Rz(ROT) Ry(θ) Rx(α) diag(1, 1, hand) (P − C) + t."""

    def __init__(self, name, rots, x_tilts, shifts, raw_size, hand=1):
        self.directory = harness.fresh_directory(name)
        self.rots, self.x_tilts, self.shifts, self.raw_size = rots, x_tilts, shifts, raw_size
        width, height = raw_size
        centre = np.array([WIDTH, HEIGHT, THICKNESS]) / 2
        v, u = np.mgrid[:height, :width] + 0.5
        self.views = np.random.default_rng(1).normal(0, NOISE, (len(TILTS), height, width))
        for view, rot, tilt, x_tilt, shift in zip(self.views, rots, TILTS, x_tilts, shifts):
            turn = rotation("z", rot) @ rotation("y", tilt) @ rotation("x", x_tilt)
            for position, sigma, density in BEADS:
                p = turn @ ((np.array(position) - centre) * [1, 1, hand])
                r2 = ((u - width / 2 - p[0] - shift[0])**2 + (v - height / 2 - p[1] - shift[1])**2)
                view += density * sigma * np.sqrt(2 * np.pi) * np.exp(-r2 / (2 * sigma**2))
        self.stack = self.path("raw.mrc")
        harness.write_stack(self.stack, self.views.astype(np.float32))
        np.savetxt(self.path("raw.tlt"), TILTS, fmt="%.2f")
        np.savetxt(self.path("raw.xtilt"), x_tilts, fmt="%.3f")
        self.input = [self.stack, "--tlt", self.path("raw.tlt"), "--xtilt", self.path("raw.xtilt")]

    def path(self, name):
        return os.path.join(self.directory, name)

    def with_xf(self):
        """Writes raw → aligned transforms: q = A (p − c_raw) + D with A = R(−ROT), D = −A t."""
        rows = []
        for rot, shift in zip(self.rots, self.shifts):
            a = rotation("z", -rot)[:2, :2]
            rows.append([*a.ravel(), *(-a @ shift)])
        np.savetxt(self.path("raw.xf"), rows, fmt="%.7f")
        return [*self.input, "--xf", self.path("raw.xf")]

    def with_aln(self):
        with open(self.path("raw.aln"), "w") as file:
            file.write(f"# AreTomo Alignment\n# RawSize = {self.raw_size[0]} "
                       f"{self.raw_size[1]} {len(TILTS)}\n# NumPatches = 0\n"
                       "# SEC ROT GMAG TX TY SMEAN SFIT SCALE BASE TILT\n")
            for i, (rot, shift, tilt) in enumerate(zip(self.rots, self.shifts, TILTS)):
                file.write(f"{i} {rot:.4f} 1.0 {shift[0]:.4f} {shift[1]:.4f} 1 1 1 0 {tilt:.2f}\n")
        return [*self.input, "--aln", self.path("raw.aln")]

    def command(self, name, alignment, *options):
        self.results = harness.fresh_results(name)
        defaults = ["--contrast", "bright", "--thickness", THICKNESS, "--field", "grid",
                    "--leaf-size", 16, "--epochs", 12, "--learning-rate", 0.05,
                    "--engine", "ray", "--threads", 1]
        return ["reconstruct", *alignment, "-o", self.results.volume_path,
                *harness.merge(defaults, options)]

    def reconstruct(self, name, alignment, *options):
        succeed(*self.command(name, alignment, *options))
        return self.results


def varied(seed, spread):
    return np.random.default_rng(seed).uniform(-spread, spread, len(TILTS))


def shifts_of(seed, spread=3.0):
    return np.random.default_rng(seed).uniform(-spread, spread, (len(TILTS), 2))


@pytest.fixture(scope="module")
def general():
    """Returns a series with rotations, shifts and x-axis tilts of every view."""
    return RawSeries("general", rots=-83 + varied(2, 3), shifts=shifts_of(4),
                     x_tilts=np.linspace(-12, 12, len(TILTS)) + varied(3, 3),
                     raw_size=(HEIGHT, WIDTH))


def centre_of_mass(volume, box):
    """Returns (X, Y, Z) of the voxels of a box [x0, x1, y0, y1, z0, z1] above a fifth of its
    peak."""
    x0, x1, y0, y1, z0, z1 = box
    part = volume[z0:z1, y0:y1, x0:x1]
    weights = np.where(part > 0.2 * part.max(), part, 0)
    z, y, x = np.indices(part.shape) + 0.5
    return np.array([(weights * a).sum() / weights.sum() for a in (x + x0, y + y0, z + z0)])


def check_volume(name, volume, least_correlation):
    expected = truth()
    assert volume.shape == expected.shape, (name, volume.shape)
    correlation = np.corrcoef(volume.ravel(), expected.ravel())[0, 1]
    mirrored = np.corrcoef(volume.ravel(), expected[::-1].ravel())[0, 1]
    pair = [24, 42, 6, 21, 2, 17]  # the first two beads
    off = np.abs(centre_of_mass(volume, pair) - centre_of_mass(expected, pair)).max()
    print(f"{name}: correlation {correlation:.4f} (mirrored in Z {mirrored:.4f}), off {off:.3f} px")
    assert correlation > least_correlation, (name, correlation)
    assert mirrored < 0.6, (name, mirrored)
    assert off < 0.2, (name, off)


def test_slab_engine_refuses_and_names_the_ray_engine(general):
    command = general.command("refused", general.with_xf(), "--engine", "slab")
    result = tomofield(*command)
    assert result.returncode == 2 and "--engine ray" in result.stderr, result
    assert "x-axis tilt" in result.stderr and not os.path.exists(general.results.volume_path)


def test_rotation_shift_and_x_tilt_from_imod_files(general):
    results = general.reconstruct("xf", general.with_xf(), "--no-margin")
    check_volume("xf", results.volume, 0.97)
    check_volume("xf, vm", general.reconstruct("vm", general.with_xf(), "--field", "vm", "--rank", 8,
                                               "--no-margin").volume, 0.96)
    check_volume("xf, margin", general.reconstruct("margin", general.with_xf()).volume, 0.96)


def test_alignment_of_aretomo(general):
    results = general.reconstruct("aln", general.with_aln(), "--no-margin")
    check_volume("aln", results.volume, 0.97)


def test_an_alignment_that_is_left_out_is_missed(general):
    results = general.reconstruct("no_x_tilt", [*general.with_xf()[:3], *general.with_xf()[5:]],
                                  "--no-margin")
    correlation = np.corrcoef(results.volume.ravel(), truth().ravel())[0, 1]
    print(f"without --xtilt: correlation {correlation:.4f}")
    assert correlation < 0.93, correlation


def test_the_other_hand():
    other = RawSeries("other_hand", rots=4 + varied(5, 2), x_tilts=varied(6, 5),
                      shifts=shifts_of(7), raw_size=(WIDTH, HEIGHT), hand=-1)
    results = other.reconstruct("hand", other.with_xf(), "--no-margin", "--hand", -1)
    check_volume("hand -1", results.volume, 0.96)


def test_binned_views_and_a_region_of_interest(general):
    results = general.reconstruct("roi", general.with_xf(), "--roi", "20,4,44,36")
    expected = truth()[:, 4:36, 20:44]
    correlation = np.corrcoef(results.volume.ravel(), expected.ravel())[0, 1]
    print(f"roi: correlation {correlation:.4f}")
    assert correlation > 0.95, correlation
    results = general.reconstruct("bin", general.with_xf(), "--bin", 2, "--no-margin", "--epochs", 25)
    coarse = truth().reshape(THICKNESS // 2, 2, HEIGHT // 2, 2, WIDTH // 2, 2).mean((1, 3, 5))
    correlation = np.corrcoef(results.volume.ravel(), coarse.ravel())[0, 1]
    print(f"bin 2: correlation {correlation:.4f}")
    assert correlation > 0.93, correlation


def test_masks_lie_where_beads_are_in_the_recorded_views(general):
    # Each spot of gold is in one view only, so that only the list of fiducials names it.
    painted = general.views.copy()
    v, u = np.mgrid[:WIDTH, :HEIGHT] + 0.5
    spots = np.random.default_rng(8).uniform(6, 34, (len(TILTS), 2))
    for view, (x, y) in zip(painted, spots):
        view[(u - x)**2 + (v - y)**2 < 2**2] += 60
    stack, fiducials = general.path("gold.mrc"), general.path("gold.txt")
    harness.write_stack(stack, painted.astype(np.float32))
    np.savetxt(fiducials, np.column_stack([spots, np.arange(len(TILTS))]), fmt="%.2f")
    alignment = [stack, *general.with_xf()[1:]]

    def correlation(name, *options):
        volume = general.reconstruct(name, alignment, "--no-margin", *options).volume
        return np.corrcoef(volume.ravel(), truth().ravel())[0, 1]

    seen = correlation("gold")
    hidden = correlation("gold_masked", "--fiducials", fiducials, "--bead-diameter",
                         4 * harness.PIXEL_SIZE / 10)
    print(f"gold: correlation {seen:.4f}, masked {hidden:.4f}")
    assert seen < 0.8 and hidden > 0.96, (seen, hidden)


def test_both_engines_agree_on_an_aligned_series():
    zeros = np.zeros(len(TILTS))
    plain = RawSeries("plain", rots=zeros, x_tilts=zeros, shifts=np.zeros((len(TILTS), 2)),
                      raw_size=(WIDTH, HEIGHT))
    ray = plain.reconstruct("plain_ray", plain.input, "--no-margin").volume
    slab = plain.reconstruct("plain_slab", plain.input, "--no-margin", "--engine", "slab").volume
    check_volume("plain, ray", ray, 0.97)
    correlation = np.corrcoef(ray.ravel(), slab.ravel())[0, 1]
    print(f"slab and ray: correlation {correlation:.4f}")
    assert correlation > 0.98, correlation


def test_same_bits_for_any_threads_and_after_an_interruption(general):
    options = ["--epochs", 4, "--ray-samples", 20, "--view-scale", "on", "--no-margin",
               "--checkpoint-minutes", 0]
    one = general.reconstruct("one", general.with_xf(), *options, "--threads", 1)
    two = general.reconstruct("two", general.with_xf(), *options, "--threads", 3)
    assert one.same_as(two)
    command = general.command("stopped", general.with_xf(), *options, "--threads", 2)
    run = harness.start(*command)
    for line in run.stderr:
        if line.startswith("reconstruct "):  # the first step is done
            break
    run.send_signal(signal.SIGINT)
    run.communicate()
    assert run.returncode == 130, run.returncode
    resumed = succeed(*command, "--resume")
    assert "resuming" in resumed.stderr, resumed.stderr
    assert general.results.same_as(one)
    # A series with another alignment is another series.
    shifted = read_bytes(general.path("raw.xf"))
    np.savetxt(general.path("raw.xf"), np.loadtxt(general.path("raw.xf")) + [0, 0, 0, 0, 0.5, 0],
               fmt="%.7f")
    os.remove(general.results.volume_path)
    refused = tomofield(*command, "--resume")
    with open(general.path("raw.xf"), "wb") as file:
        file.write(shifted)
    assert refused.returncode == 2 and "alignment" in refused.stderr, refused
