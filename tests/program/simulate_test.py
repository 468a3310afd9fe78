"""Tests simulate against a reference in numpy, and the effects of its options."""

import filecmp
import io
import json
import os
import re
import shlex
import shutil

import mrcfile
import numpy as np
import pytest
import scipy.interpolate
import scipy.ndimage

import cell_reference
import harness


def run(*arguments, threads=None):
    env = dict(os.environ, **({"OMP_NUM_THREADS": str(threads)} if threads else {}))
    return harness.tomofield(*arguments, env=env)


def simulate(name, *options, threads=None):
    """Runs simulate into a new directory and returns its results."""
    directory = harness.fresh_directory(name)
    os.rmdir(directory)  # simulate makes it
    result = run("simulate", directory, *options, threads=threads)
    assert result.returncode == 0, result.stderr
    return Series(directory)


class Series:
    def __init__(self, directory):
        self.directory = directory
        self.record = json.load(open(self.path("phantom.json")))
        self.views = self.record["views"]

    def path(self, name):
        return os.path.join(self.directory, name)

    def read(self, name):
        with mrcfile.open(self.path(name)) as file:
            return file.data.astype(np.float64)


def test_the_command_that_reconstructs_has_quoted_names():
    folder = harness.fresh_directory("quoted")
    name = "it's; touch made #"
    said = harness.succeed("simulate", name, "--size", 48, "--thickness", 24, "--tilts=-60:60:20", cwd=folder)
    command = said.stdout.split("reconstruct it with: ")[1].splitlines()[0]
    assert shlex.split(command, comments=True)[2] == os.path.join(name, "tilt_series.mrc"), command


def test_truth_and_projections_are_those_of_the_recorded_ellipsoids():
    for size, thickness, is_extended, options in (
        (64, 40, False, ["--tilts=-70:69.5:15.5"]),
        (65, 33, True, ["--tilts=-60:60:12", "--extended"]),
    ):
        ours = simulate("same", "--size", size, "--thickness", thickness, *options)
        assert len(ours.record["ellipsoids"]) > 20
        reference = cell_reference.Cell(size, thickness, is_extended, ours.record["ellipsoids"])
        tilts = np.loadtxt(ours.path("tilt_series.tlt"))
        first, last, step = map(float, options[0].split("=")[1].split(":"))
        np.testing.assert_allclose(tilts, np.arange(first, last + 1e-6, step), atol=1e-4)
        views = reference.views(tilts)
        sigma = reference.noise_sigma(0.05, tilts)
        np.testing.assert_allclose(ours.read("truth.mrc"), reference.truth(), atol=1e-6)
        np.testing.assert_allclose(ours.read("clean.mrc"), views, atol=2e-5, rtol=1e-6)
        np.testing.assert_allclose(ours.record["noise_sigma"], sigma, rtol=1e-5)
        noise = ours.read("tilt_series.mrc") - ours.read("clean.mrc")
        assert abs(noise.std() / sigma - 1) < 0.02 and abs(noise.mean()) < 0.02 * noise.std()
        for name, group in (("truth.mrc", 1), ("clean.mrc", 0), ("tilt_series.mrc", 0)):
            assert mrcfile.validate(ours.path(name), print_file=io.StringIO()), name
            with mrcfile.open(ours.path(name)) as file:
                assert int(file.header.ispg) == group and abs(file.voxel_size.x - 10) < 1e-5, name


def test_seeds_have_the_statistics_of_the_recipe():
    seeds, size, thickness, tilts = 12, 64, 40, [0.0, 60.0]
    for is_extended in (False, True):
        figures = {"ours": [], "theirs": []}
        for seed in range(seeds):
            ours = simulate("statistics", "--size", size, "--thickness", thickness,
                            "--tilts=0:60:60", "--seed", seed, *["--extended"] * is_extended)
            truth = ours.read("truth.mrc")
            count = len(ours.record["ellipsoids"])
            figures["ours"].append([count, truth.mean(), truth.std(), ours.record["noise_sigma"]])
            theirs = cell_reference.draw_cell(size, thickness, is_extended, max(tilts), seed)
            truth = theirs.truth()
            figures["theirs"].append([len(theirs.bodies), truth.mean(), truth.std(),
                                      theirs.noise_sigma(0.05, tilts)])
        ours, theirs = np.array(figures["ours"]), np.array(figures["theirs"])
        error = np.sqrt((ours.var(0, ddof=1) + theirs.var(0, ddof=1)) / seeds)
        deviation = (ours.mean(0) - theirs.mean(0)) / error
        assert (abs(deviation) < 4).all(), (is_extended, ours.mean(0), theirs.mean(0), error)


def test_yardsticks_are_cells_with_the_projects_views_and_thickness():
    for yardstick, options, views in (("a", ["--tilts=-70:69.5:1.5"], 94),
                                      ("b", ["--extended", "--tilts=-60:60:2"], 61)):
        ours = simulate("yardstick", "--yardstick", yardstick, "--size", 32, "--seed", 3)
        by_hand = simulate("by_hand", *options, "--size", 32, "--thickness", 19, "--seed", 3)
        assert len(ours.views) == views
        for name in FILES:
            assert filecmp.cmp(ours.path(name), by_hand.path(name), shallow=False), name
    other = simulate("other_thickness", "--yardstick", "b", "--size", 32, "--thickness", 12)
    assert other.read("truth.mrc").shape == (12, 32, 32)


def test_yardstick_c_is_what_its_record_says():
    size, thickness = 64, 38
    ours = simulate("textured", "--yardstick", "c", "--size", size, "--seed", 3)
    beads, blobs = ours.record["gold_beads"], ours.record["blobs_x_y_z_sigma_peak"]
    assert len(beads) > 0 and len(blobs) > 500 and len(ours.views) == 61
    gains = np.array([view["gain"] for view in ours.views])
    assert 0.02 < np.log(gains).std() < 0.04
    specimen = cell_reference.Cell(size, thickness, True, ours.record["ellipsoids"], blobs)
    truth = ours.read("truth.mrc")  # without gold
    np.testing.assert_allclose(truth, specimen.truth(), atol=1e-6)
    assert truth.min() > -0.1 and truth.max() < 1.3
    np.testing.assert_allclose(ours.record["noise_sigma"], specimen.noise_sigma(0.05, [0]), rtol=1e-5)
    clean = ours.read("clean.mrc")
    for view in (0, 18, 30, 53):
        gold = cell_reference.Cell(size, thickness, True, [solid(bead) for bead in beads])
        gold = gold.view(-60 + 2 * view) - cell_reference.SLAB * thickness / np.cos(
            np.radians(-60 + 2 * view))
        expected = gains[view] * (specimen.view(-60 + 2 * view) + gold)
        np.testing.assert_allclose(clean[view], expected, atol=5e-5, rtol=1e-6)


COUNTED = ["--yardstick", "d", "--size", 64, "--voxel-size", 20, "--gold", 2]


@pytest.fixture(name="counted", scope="module")
def make_counted():
    return simulate("counted", *COUNTED, "--seed", 4)


def test_yardstick_d_counts_electrons(counted):
    expected, counts = counted.read("clean.mrc"), counted.read("tilt_series.mrc")
    even, odd = counted.read("tilt_series_even.mrc"), counted.read("tilt_series_odd.mrc")
    assert counts.shape == (41, 64, 64) and (counts == np.round(counts)).all()
    np.testing.assert_array_equal(even + odd, counts)
    for values, mean in ((counts, expected), (even, expected / 2), (odd, expected / 2)):
        inside = mean > 5  # gold lets few electrons through
        deviates = ((values - mean) / np.sqrt(np.maximum(mean, 1e-6)))[inside]
        assert abs(deviates.mean()) < 5 / np.sqrt(deviates.size)
        assert abs(deviates.var() - 1) < 5 * np.sqrt(2.1 / deviates.size)
    halves = (even - expected / 2) * (odd - expected / 2) / np.maximum(expected / 2, 1)
    assert abs(halves.mean()) < 5 / np.sqrt(halves.size)
    # 3 electrons per Å² on pixels of 400 Å², behind 1120 Å of ice of a mean free path of 3000 Å
    for view in (0, 20):
        path = 1120 / 3000 / np.cos(np.radians(counted.views[view]["tilt_deg"]))
        assert abs(np.median(expected[view]) / (1200 * np.exp(-path)) - 1) < 0.05, view


def test_yardstick_d_is_a_weak_phase_object_behind_its_contrast_transfer(counted):
    views = counted.views
    assert [view["tilt_deg"] for view in views] == list(range(-60, 61, 3))
    defoci = np.array([np.mean(view["defocus_A"]) for view in views])
    assert 15000 < defoci.mean() < 45000 and 500 < defoci.std() < 3000
    pixel, middle = 20, 20
    potential = counted.read("truth.mrc").sum(0) * pixel  # V Å
    contrast = -2 * 6.526e-4 * imaged(potential, views[middle], pixel)
    background = 1200 * np.exp(-1120 / 3000)
    expected = background * (1 + contrast)
    y, x = np.meshgrid(*[np.arange(64) - 31.5] * 2, indexing="ij")
    clear = (abs(x) < 24) & (abs(y) < 24)
    for bead in counted.record["gold_beads"]:
        clear &= np.hypot(x - bead["center_px"][0], y - bead["center_px"][1]) > 10
    found = counted.read("clean.mrc")[middle]
    assert clear.sum() > 500
    assert (found - expected)[clear].std() < 0.1 * expected[clear].std()
    assert np.corrcoef(found[clear], expected[clear])[0, 1] > 0.99


def test_files_of_yardstick_d_are_read_with_the_same_defocus_and_doses(counted):
    order = np.argsort([view["exposure_before"] for view in counted.views])
    assert [3 * (i - 20) for i in order[:5]] == [0, 3, -3, -6, 6]
    ctf = np.loadtxt(counted.path("tilt_series_ctf.txt"))
    np.testing.assert_allclose(ctf[:, 1:3], [view["defocus_A"] for view in counted.views])
    said = harness.succeed("reconstruct", counted.path("tilt_series.mrc"), "--tlt",
                           counted.path("tilt_series.tlt"), "--thickness", 56, "--ctf",
                           counted.path("tilt_series_ctf.txt"), "--mdoc",
                           counted.path("tilt_series.mdoc"), "--dry-run", "-o",
                           counted.path("none.mrc"))
    assert "ctf" in said.stdout + said.stderr and "dose" in said.stdout + said.stderr


def test_particles_of_yardstick_d_are_found_in_its_truth(counted):
    said = harness.succeed("evaluate", counted.path("truth.mrc"), "--particles",
                           counted.path("particles.star"), "--membranes",
                           counted.path("membranes.mrc"), "--json", counted.path("found.json")).stdout
    found = json.load(open(counted.path("found.json")))
    kinds = found["picks"]["kinds"]
    assert kinds["ribosome"]["particles"] >= 5
    assert kinds["ribosome"]["average_precision"] > 0.7, said
    # A score that says nothing would have the precision that labelled voxels are of all.
    labelled = (counted.read("membranes.mrc") > 0).mean()
    assert found["membranes"]["average_precision"] > 5 * labelled, said
    # The same list moved by a quarter of the field finds less.
    moved = os.path.join(counted.directory, "moved.star")
    with open(counted.path("particles.star")) as file, open(moved, "w") as out:
        for line in file:
            words = line.split()
            if len(words) == 7:
                words[0] = str((float(words[0]) + 16) % 64)
            out.write("\t".join(words) + "\n")
    other = harness.succeed("evaluate", counted.path("truth.mrc"), "--particles", moved, "--json",
                            counted.path("moved.json"))
    assert other.returncode == 0
    kinds = json.load(open(counted.path("moved.json")))["picks"]["kinds"]
    assert kinds["ribosome"]["average_precision"] < 0.5


def test_a_density_is_not_replaced_by_the_series_that_is_made_of_it(counted):
    density = os.path.join(harness.fresh_directory("of_its_density"), "truth.mrc")
    shutil.copy(counted.path("particle_ribosome.mrc"), density)
    before = harness.read_bytes(density)
    said = run("simulate", os.path.dirname(density), *COUNTED, "--particles", f"{density},2",
               "--overwrite")
    assert said.returncode == 2 and "would replace the input" in said.stderr, said.stderr
    assert harness.read_bytes(density) == before


def test_files_that_are_called_like_densities_stay(counted):
    folder = harness.fresh_directory("called_like_densities")
    mine = os.path.join(folder, "particle_mine.mrc")
    shutil.copy(counted.path("particle_ribosome.mrc"), mine)
    harness.succeed("simulate", folder, "--size", 48, "--thickness", 24, "--tilts=-60:60:20")
    harness.succeed("simulate", folder, *COUNTED, "--particles", f"{mine},2", "--overwrite")
    own = os.path.join(folder, "particle_particle_mine.mrc")
    assert os.path.exists(mine) and os.path.exists(own)
    said = harness.tomofield("simulate", folder, *COUNTED, "--particles", f"{own},2", "--overwrite")
    assert said.returncode == 2 and "input" in said.stderr and os.path.exists(own), said
    harness.succeed("simulate", folder, "--size", 48, "--thickness", 24, "--tilts=-60:60:20", "--overwrite")
    assert os.path.exists(mine) and not os.path.exists(own)


def test_particles_of_files_take_the_place_of_random_proteins(counted):
    source = os.path.join(counted.directory, "particle_ribosome.mrc")
    ours = simulate("files", *COUNTED, "--particles", f"{source},12")
    rows = [line.split() for line in open(ours.path("particles.star")) if len(line.split()) == 7]
    kinds = [words[6] for words in rows]
    assert set(kinds) <= {"receptor", "particle_ribosome"}
    assert 5 <= kinds.count("particle_ribosome") <= 19  # 12 on average, less what finds no place
    # The new reference looks like the file's density.
    given = counted.read("particle_ribosome.mrc")
    made = ours.read("particle_particle_ribosome.mrc")
    n = min(len(given), len(made)) // 2
    middle = [slice(len(v) // 2 - n, len(v) // 2 + n) for v in (given, made)]
    assert np.corrcoef(given[(middle[0],) * 3].ravel(), made[(middle[1],) * 3].ravel())[0, 1] > 0.9


def test_particles_that_no_field_of_view_holds_are_refused(counted, tmp_path):
    for voxel_A in (1e6, 200, 0.01):
        with mrcfile.new(tmp_path / "one.mrc", counted.read("particle_ribosome.mrc").astype(np.float32),
                         overwrite=True) as file:
            file.set_volume()
            file.voxel_size = voxel_A
        said = harness.tomofield("simulate", tmp_path / "s", *COUNTED, "--particles", f"{tmp_path}/one.mrc,2")
        assert said.returncode == 2 and "the field of view" in said.stderr and "one.mrc" in said.stderr, said
        assert not os.path.exists(tmp_path / "s")


def test_yardstick_d_is_made_by_its_seed_whatever_the_threads():
    first = simulate("first", *COUNTED, "--seed", 4, threads=1)
    again = simulate("again", *COUNTED, "--seed", 4, threads=2)
    other = simulate("other", *COUNTED, "--seed", 5)
    names = [*FILES, "tilt_series_even.mrc", "tilt_series_odd.mrc", "membranes.mrc", "particles.star",
             "particle_ribosome.mrc", "tilt_series_ctf.txt", "tilt_series.defocus", "tilt_series.mdoc"]
    for name in names:
        assert filecmp.cmp(first.path(name), again.path(name), shallow=False), name
    assert not filecmp.cmp(first.path("truth.mrc"), other.path("truth.mrc"), shallow=False)
    # A plain series removes what only yardstick D writes.
    assert run("simulate", first.directory, *SMALL, "--overwrite").returncode == 0
    assert sorted(os.listdir(first.directory)) == sorted(FILES)


def solid(bead):
    """Returns a bead as an ellipsoid of the record."""
    return {**bead, "q": np.eye(3) / bead["radius_px"] ** 2, "inner_to_outer_ratio": 0,
            "wall_density": bead["density"], "inside_density": bead["density"]}


def test_options_win_over_yardstick_c_and_the_content_stays():
    usual = simulate("usual", "--yardstick", "c", "--size", 32)
    plain = simulate("plain", "--yardstick", "c", "--size", 32, "--gold", 0, "--gain", 0)
    assert not plain.record["gold_beads"] and all(view["gain"] == 1 for view in plain.views)
    assert filecmp.cmp(usual.path("truth.mrc"), plain.path("truth.mrc"), shallow=False)
    assert usual.record["noise_sigma"] == plain.record["noise_sigma"]


def test_yardstick_c_says_how_it_is_reconstructed():
    said = harness.succeed("simulate", harness.fresh_directory("said"), "--yardstick", "c", "--size",
                           128, "--no-truth", "--noise", 0.05).stdout
    assert re.search(r"\d+ ellipsoids, \d+ Gaussian blobs, 61 views, \d+ gold beads", said), said
    command = said.split("reconstruct it with: tomofield ")[1].split()
    assert "--view-scale on" in said and "--bead-diameter 10 " in said and "--no-margin" not in said
    harness.succeed(*command, "--dry-run")


@pytest.mark.parametrize("kind", ("c", "d"))
def test_the_command_for_a_small_series_runs_though_its_beads_are_too_large_to_be_found(kind):
    said = harness.succeed("simulate", harness.fresh_directory("small" + kind), "--yardstick", kind,
                           "--size", 64, "--no-truth").stdout
    assert "--bead-diameter 0 " in said
    harness.succeed(*said.split("reconstruct it with: tomofield ")[1].split(), "--dry-run")


SMALL = ["--size", 48, "--thickness", 30, "--tilts", "-60:60:10"]
FILES = ["tilt_series.mrc", "clean.mrc", "truth.mrc", "tilt_series.tlt", "phantom.json"]


def test_same_seed_same_bytes_whatever_the_threads():
    options = [*SMALL, "--defocus", "2:4", "--gold", 5, "--gain", 0.1, "--misalign", 2, "--misalign-local", 1,
               "--dose", 50, "--gold-diameter", 40]
    one = simulate("one", *options, threads=1)
    two = simulate("two", *options, threads=2)
    other = simulate("other", *options, "--seed", 8)
    for name in [*FILES, "tilt_series.xf"]:
        assert filecmp.cmp(one.path(name), two.path(name), shallow=False), name
    assert not filecmp.cmp(one.path("truth.mrc"), other.path("truth.mrc"), shallow=False)


def test_dark_contrast_and_gain():
    plain = simulate("plain", *SMALL)
    dark = simulate("dark", *SMALL, "--contrast", "dark", "--gain", 0.2)
    gains = np.array([view["gain"] for view in dark.views])
    assert 0.05 < np.log(gains).std() < 0.5
    assert all(view["gain"] == 1 for view in plain.views)
    expected = gains[:, None, None] * (dark.record["empty_beam"] - plain.read("clean.mrc"))
    np.testing.assert_allclose(dark.read("clean.mrc"), expected, rtol=1e-5, atol=1e-4)
    assert dark.read("clean.mrc").min() > 0
    noise = dark.read("tilt_series.mrc") - dark.read("clean.mrc")
    assert abs(noise.std() / plain.record["noise_sigma"] - 1) < 0.03


def test_dose_gives_poisson_counts_of_the_attenuated_beam():
    plain = simulate("plain", *SMALL)
    for dose in (8, 400):
        counted = simulate("counted", *SMALL, "--dose", dose)
        clean, counts = counted.read("clean.mrc"), counted.read("tilt_series.mrc")
        absorption_per_px = counted.record["options"]["absorption_per_A"] * 10
        expected = dose * np.exp(-absorption_per_px * plain.read("clean.mrc"))
        np.testing.assert_allclose(clean, expected, rtol=1e-5)
        assert (counts == np.round(counts)).all() and (counts >= 0).all()
        deviates = (counts - clean) / np.sqrt(clean)
        assert abs(deviates.mean()) < 5 / np.sqrt(deviates.size), deviates.mean()
        spread = np.sqrt((2 + 1 / clean.mean()) / deviates.size)
        assert abs(deviates.var() - 1) < 5 * spread, deviates.var()


# At this size the membranes are sampled well enough to interpolate.
SMOOTH = ["--size", 128, "--thickness", 90, "--tilts=-60:60:10", "--extended", "--no-truth"]
INSIDE = (slice(20, -20), slice(20, -20))


def test_transforms_undo_the_shifts():
    plain = simulate("plain", *SMOOTH)
    shifted = simulate("shifted", *SMOOTH, "--misalign", 3)
    assert not os.path.exists(plain.path("tilt_series.xf"))
    transforms = np.loadtxt(shifted.path("tilt_series.xf"))
    assert transforms.shape == (13, 6) and (transforms[:, :4] == [1, 0, 0, 1]).all()
    assert abs(transforms[:, 4:]).max() > 2
    expected, moved = plain.read("clean.mrc"), shifted.read("clean.mrc")
    for view, (dx, dy) in enumerate(transforms[:, 4:]):
        # raw -> aligned: X' = X + DX, so the aligned image is the raw one moved by (DX, DY)
        aligned = scipy.ndimage.shift(moved[view], (dy, dx), order=3)
        here = np.corrcoef(aligned[INSIDE].ravel(), expected[view][INSIDE].ravel())[0, 1]
        assert here > 0.99, (view, here)
        record = shifted.views[view]["shift_px"]
        np.testing.assert_allclose([-dx, -dy], record, atol=1e-9)


def error_of(image, expected):
    """Returns the rms error inside of the image, divided by the contrast that is expected there."""
    return (image - expected)[INSIDE].std() / expected[INSIDE].std()


def test_transforms_undo_rotations_and_magnifications():
    plain = simulate("plain", *SMOOTH)
    turned = simulate("turned", *SMOOTH, "--misalign", 2, "--misalign-rotation", 1.5,
                      "--misalign-magnification", 1, "--misalign-axis", -4)
    transforms = np.loadtxt(turned.path("tilt_series.xf"))
    expected, recorded = plain.read("clean.mrc"), turned.read("clean.mrc")
    rotations = []
    for view, line in enumerate(transforms):
        record = turned.views[view]
        angle, scale = np.deg2rad(record["rotation_deg"]), record["magnification"]
        rotations.append(record["rotation_deg"])
        matrix = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        # The record maps aligned to raw, the file raw to aligned: q = A p + (DX, DY).
        inverse = line[:4].reshape(2, 2)
        np.testing.assert_allclose(inverse @ matrix, np.eye(2), atol=2e-7)
        np.testing.assert_allclose(-np.linalg.inv(inverse) @ line[4:], record["shift_px"], atol=1e-9)
        # scipy maps indices (y, x) of the output to those of the input. The centre is 63.5.
        back = np.linalg.inv(inverse)[::-1, ::-1]
        offset = np.array(record["shift_px"])[::-1] + 63.5 - back @ [63.5, 63.5]
        aligned = scipy.ndimage.affine_transform(recorded[view], back, offset, order=3)
        assert error_of(aligned, expected[view]) < 0.1, (view, error_of(aligned, expected[view]))
        assert error_of(recorded[view], expected[view]) > 0.2
    assert abs(np.mean(rotations) + 4) < 1.5 and 0.5 < np.std(rotations) < 3


def node_weights(place):
    """Returns the weights of five nodes along a side of 128 pixels at places from its middle."""
    nodes = np.linspace(-64, 64, 5)
    slopes = np.gradient(np.eye(5), nodes, axis=0)  # central inside, to one side at the edges
    return scipy.interpolate.CubicHermiteSpline(nodes, np.eye(5), slopes)(np.clip(place, -64, 64))


def test_local_motion_is_what_the_record_says():
    plain = simulate("plain", *SMOOTH)
    warped = simulate("warped", *SMOOTH, "--misalign", 1, "--misalign-rotation", 1, "--misalign-local", 2)
    transforms = np.loadtxt(warped.path("tilt_series.xf"))
    expected, recorded = plain.read("clean.mrc"), warped.read("clean.mrc")
    y, x = np.meshgrid(*[np.arange(128) - 63.5] * 2, indexing="ij")
    squares = []
    for view, (a11, a12, a21, a22, dx, dy) in enumerate(transforms):
        qx, qy = a11 * x + a12 * y + dx, a21 * x + a22 * y + dy
        local = np.einsum("yxr,yxc,rcd->dyx", node_weights(qy), node_weights(qx),
                          warped.views[view]["local_px"])
        squares.append((local**2).sum(0).mean())
        with_local = scipy.ndimage.map_coordinates(
            expected[view], [qy + local[1] + 63.5, qx + local[0] + 63.5], order=3)
        without = scipy.ndimage.map_coordinates(expected[view], [qy + 63.5, qx + 63.5], order=3)
        assert error_of(recorded[view], with_local) < 0.1, (view, error_of(recorded[view], with_local))
        assert error_of(recorded[view], without) > 0.2, (view, error_of(recorded[view], without))
    assert abs(np.sqrt(np.mean(squares)) - 2) < 0.1


def test_gold_beads_are_where_the_record_says():
    plain = simulate("plain", *SMALL)
    gold = simulate("gold", *SMALL, "--gold", 6, "--gold-diameter", 50, "--gold-density", 7)
    beads = gold.record["gold_beads"]
    assert len(beads) == 6 and len(gold.record["ellipsoids"]) == len(plain.record["ellipsoids"])
    z, y, x = np.meshgrid(*(np.arange(n) + 0.5 - n / 2 for n in (30, 48, 48)), indexing="ij")
    expected = plain.read("truth.mrc")
    for bead in beads:
        cx, cy, cz = bead["center_px"]
        assert bead["radius_px"] == 2.5
        expected += 7 * ((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2 < 2.5**2)
    np.testing.assert_allclose(gold.read("truth.mrc"), expected, atol=1e-5)


def transfer(kx, ky, view, more_defocus=0.0):
    """Returns minus the contrast transfer function as CTFFIND4 defines it, at 300 kV with a Cs of 2.7 mm
    and an amplitude contrast of 0.07, times the signal that Grant and Grigorieff's exposure filter
    leaves."""
    wavelength = 12.2643 / np.sqrt(300e3 + 0.978476e-6 * 300e3**2)
    k2, direction = kx**2 + ky**2, np.arctan2(ky, kx) - np.radians(view["defocus_angle_deg"])
    u, v = view["defocus_A"]
    defocus = (u + v) / 2 + (u - v) / 2 * np.cos(2 * direction) + more_defocus
    chi = np.pi * wavelength * k2 * (defocus - wavelength**2 * k2 * 2.7e7 / 2)
    dose = view["exposure_before"] + view["exposure"] / 2
    with np.errstate(divide="ignore"):
        signal = np.exp(-dose / 2 / (0.245 * np.sqrt(k2) ** -1.665 + 2.81))
    return signal * (np.sqrt(1 - 0.07**2) * np.sin(chi) + 0.07 * np.cos(chi))


def imaged(projection, view, pixel, has_slope=True):
    """Filters a projection column by column, each with the defocus of its own place."""
    pad = 40
    wide = np.pad(projection, pad, mode="reflect")
    kx, ky = np.meshgrid(*[np.fft.fftfreq(len(wide), pixel)] * 2)
    spectrum = np.zeros(wide.shape, complex)
    for x in range(len(wide)):
        column = np.zeros_like(wide)
        column[:, x] = wide[:, x]
        slope = np.tan(np.radians(view["tilt_deg"])) * pixel * has_slope
        spectrum += np.fft.fft2(column) * transfer(kx, ky, view, slope * (x + 0.5 - len(wide) / 2))
    return np.fft.ifft2(spectrum).real[pad:-pad, pad:-pad]


IMAGING = ["--defocus", "3:5", "--astigmatism", 0.4, "--dose-per-tilt", 20]


def test_views_are_filtered_by_the_local_contrast_transfer_and_by_damage():
    options = ["--size", 128, "--thickness", 60, "--extended", "--tilts=-60:60:60", "--voxel-size", 5,
               "--no-truth"]
    plain = simulate("plain", *options)
    ours = simulate("imaged", *options, *IMAGING)
    assert [view["exposure_before"] for view in ours.views] == [40, 0, 20]
    assert ours.record["noise_sigma"] == plain.record["noise_sigma"]
    clean = ours.read("clean.mrc")
    for view, projection, image in zip(ours.views, plain.read("clean.mrc"), clean):
        error = error_of(image, imaged(projection, view, 5))
        assert error < 0.015, view
        assert error_of(image, imaged(projection, {**view, "exposure": 0}, 5)) > 0.04, view
        if view["tilt_deg"] != 0:
            assert error_of(image, imaged(projection, view, 5, has_slope=False)) > 2 * error, view
    dark = simulate("dark", *options, *IMAGING, "--contrast", "dark")
    np.testing.assert_allclose(dark.read("clean.mrc"), dark.record["empty_beam"] - clean, atol=1e-4)


def test_files_of_other_programs_have_the_contrast_transfer_and_the_doses():
    series = simulate("imaged", *SMALL, *IMAGING)
    ctf = np.loadtxt(series.path("tilt_series_ctf.txt"))
    imod = np.loadtxt(series.path("tilt_series.defocus"), skiprows=1)
    mdoc = open(series.path("tilt_series.mdoc")).read()
    for i, view in enumerate(series.views):
        u, v = view["defocus_A"]
        assert 3e4 < (u + v) / 2 < 5e4 and abs(u - v - 4000) < 1e-6
        np.testing.assert_allclose(ctf[i, :5], [i + 1, u, v, view["defocus_angle_deg"], 0])
        np.testing.assert_allclose(imod[i, [0, 1, 2, 4, 5, 6]],
                                   [i + 1, i + 1, view["tilt_deg"], u / 10, v / 10,
                                    view["defocus_angle_deg"]])
        section = mdoc.split("[ZValue = ")[i + 1]
        assert f"PriorRecordDose = {view['exposure_before']:.4f}" in section
        assert "ExposureDose = 20.0000" in section
    # Tilts in steps of 10 degrees from -60 to 60, in dose-symmetric order
    order = np.argsort([view["exposure_before"] for view in series.views])
    assert [10 * (i - 6) for i in order] == [0, 10, -10, -20, 20, 30, -30, -40, 40, 50, -50, -60, 60]
    # A plain series has none of these files, and removes those of an earlier one.
    assert run("simulate", series.directory, *SMALL, "--overwrite").returncode == 0
    assert sorted(os.listdir(series.directory)) == sorted(FILES)


def test_noise_is_blurred_and_keeps_its_strength():
    series = simulate("blurred", *SMALL, "--noise-blur", 0.8)
    noise = series.read("tilt_series.mrc") - series.read("clean.mrc")
    sigma = series.record["noise_sigma"]
    assert abs(noise.std() / sigma - 1) < 0.03
    for axis in (1, 2):  # a blurred noise has the autocorrelation exp(-d² / (4 blur²))
        neighbours = (noise * np.roll(noise, 1, axis)).mean() / noise.var()
        assert abs(neighbours - np.exp(-1 / (4 * 0.8**2))) < 0.03, neighbours
    assert abs((noise[1:] * noise[:-1]).mean() / noise.var()) < 0.03


def test_existing_files_are_kept_unless_asked():
    series = simulate("kept", *SMALL, "--misalign", 1)
    before = open(series.path("tilt_series.mrc"), "rb").read()
    result = run("simulate", series.directory, *SMALL)
    assert result.returncode == 2 and "exists" in result.stderr and "--overwrite" in result.stderr
    assert open(series.path("tilt_series.mrc"), "rb").read() == before
    result = run("simulate", series.directory, *SMALL, "--overwrite", "--no-truth", "--seed", 9)
    assert result.returncode == 0, result.stderr
    assert "ellipsoids, 13 views, sigma" in result.stdout
    assert open(series.path("tilt_series.mrc"), "rb").read() != before
    # The files of the earlier series are gone.
    assert sorted(os.listdir(series.directory)) == sorted(set(FILES) - {"truth.mrc"})


def test_a_disk_without_room_is_found_before_the_work():
    ended = harness.tomofield("simulate", "immense", "--size", 20000, "--thickness", 20000, timeout=20)
    assert ended.returncode == 2 and "truth.mrc" in ended.stderr and "its disk" in ended.stderr, ended
    assert not os.path.exists("immense")


def test_bad_options_are_named_and_nothing_is_written():
    directory = os.path.join(harness.SCRATCH, "bad")
    for options, words in (
        (["--tilts", "-60:60"], "first:last:step"),
        (["--tilts", "-60:nan:2"], "range"),
        (["--tilts", "60:-60:2"], "range"),
        (["--tilts", "-85:85:5"], "80"),
        (["--size", "0"], "size"),
        (["--size", "many"], "size"),
        (["--voxel-size", "1e300"], "0.001 to 10000000"),
        (["--voxel-size", "1e-20"], "0.001 to 10000000"),
        (["--noise", "-1"], "noise"),
        (["--noise", "nan"], "noise"),
        (["--noise", "1e38"], "0 to 1e6"),
        (["--dose", "0"], "dose"),
        (["--dose", "1e-300"], "dose"),
        (["--dose", "5", "--absorption", "1e300"], "absorption"),
        (["--gold", "3", "--gold-density", "1e38"], "density"),
        (["--seed", "18446744073709551616"], "2^64 - 1"),
        (["--dose", "5", "--noise", "0.1"], "--noise"),
        (["--dose", "5", "--contrast", "bright"], "contrast"),
        (["--voxel-size", "0"], "voxel size"),
        (["--misalign", "-1"], "shifts' spread"),
        (["--misalign-rotation", "90"], "0 to 20 degrees"),
        (["--misalign-magnification", "nan"], "0 to 20 percent"),
        (["--misalign-axis", "200"], "tilt axis"),
        (["--misalign-local", "50"], "local motion"),
        (["--gold", "5", "--gold-diameter", "1e6"], "diameter"),
        (["--defocus", "3:x"], "low:high"),
        (["--defocus", "5:3"], "smaller number first"),
        (["--defocus", "nan"], "defocus"),
        (["--defocus", "4", "--amplitude-contrast", "2"], "amplitude contrast"),
        (["--astigmatism", "0.1"], "--defocus"),
        (["--dose-per-tilt", "-1"], "dose per tilt"),
        (["--noise-blur", "-1"], "blur"),
        (["--noise-blur", "1", "--dose", "5"], "--noise-blur"),
        (["--yardstick", "e"], "yardstick"),
        (["--yardstick", "d", "--voxel-size", "1e-300"], "voxel size"),
        (["--yardstick", "d", "--voxel-size", "1e300"], "voxel size"),
        (["--yardstick", "d", "--noise", "0.1"], "--dose-per-tilt"),
        (["--yardstick", "d", "--dose", "100"], "--dose-per-tilt"),
        (["--yardstick", "d", "--noise-blur", "1"], "--noise-blur"),
        (["--yardstick", "d", "--contrast", "bright"], "bright"),
        (["--yardstick", "d", "--dose-per-tilt", "0"], "dose per tilt"),
        (["--yardstick", "d", "--particles", "ribosome.mrc"], "ribosome.mrc,40"),
        (["--yardstick", "d", "--particles", "/nowhere/none.mrc,4"], "/nowhere/none.mrc"),
        (["--yardstick", "c", "--particles", "ribosome.mrc,4"], "--yardstick d"),
        (["--yardstick", "a", "--extended"], "--extended"),
        (["--yardstick", "b", "--tilts", "-60:60:3"], "--tilts"),
    ):
        result = run("simulate", directory, *options)
        assert result.returncode == 2, (options, result)
        assert words in result.stderr, (options, result.stderr)
        assert not os.path.exists(directory), options
    result = run("simulate", "/proc/nowhere/cell", *SMALL)
    assert result.returncode == 2 and "/proc/nowhere/cell" in result.stderr
