"""Tests reconstruct --tree adaptive: the tree, its updates in the JSON, its picture and
--resume."""

import json
import os

import h5py
import numpy as np
import pytest

import harness

SIZE, THICKNESS, EPOCHS = 128, 16, 10
# The tree begins with sixteen leaves of 32 px, each of 9 × 9 vertices.
OPTIONS = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin", "--tree", "adaptive",
           "--leaf-size", 32, "--vertex-spacing", 4, "--rank", 3, "--epochs", EPOCHS,
           "--subsets", 7]


@pytest.fixture(scope="module")
def series():
    """Writes the views of a small dense sphere at (36, 92), whose projections are the same at every
    tilt but for a shift. Returns the arguments that hand it to reconstruct."""
    directory = harness.fresh_directory("series")
    stack, tlt = os.path.join(directory, "series.mrc"), os.path.join(directory, "series.tlt")
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    tilts = np.radians(harness.TILTS)
    noise = np.random.default_rng(1).normal(0, 0.05, (len(tilts), SIZE, SIZE))
    views = [2 * np.sqrt(np.maximum(36 - (x - 64 + 28 * np.cos(t)) ** 2 - (y - 92) ** 2, 0))
             for t in tilts]
    harness.write_stack(stack, (np.array(views) + noise).astype(np.float32))
    np.savetxt(tlt, harness.TILTS, fmt="%.1f")
    return [stack, "--tlt", tlt]


@pytest.fixture(scope="module", name="command")
def make_command(series):
    def command(output, *options):
        return ["reconstruct", *series, "-o", output, *harness.merge(OPTIONS, options)]

    return command


def fresh_output(name):
    return os.path.join(harness.fresh_directory(name), "out.mrc")


def leaves_of(output):
    """Returns [x0, y0, size] of each leaf."""
    with h5py.File(output[:-4] + ".h5") as model:
        tree = model["field/tree"]
        nodes = np.array([tree["node_x0"][:], tree["node_y0"][:], tree["node_size"][:]]).T
        return nodes[model["field/leaves/node"][:]]


def read_png(path):
    """Reads a picture [row, column, channel] with an independent reader."""
    from skimage import io
    return io.imread(path)


@pytest.fixture(scope="module")
def whole(command):
    """Returns the volume of an undisturbed run."""
    output = fresh_output("whole")
    harness.succeed(*command(output))
    return output


def leaf_at(leaves, x, y):
    inside = [(x0 <= x < x0 + size and y0 <= y < y0 + size) for x0, y0, size in leaves]
    assert sum(inside) == 1
    return leaves[inside.index(True)]


def test_leaves_are_fine_where_the_density_varies(whole):
    leaves = leaves_of(whole)
    assert len(leaves) <= 16 and (leaves[:, 2] ** 2).sum() == SIZE**2
    assert leaf_at(leaves, 36, 92)[2] == 16, leaves
    assert leaves[:, 2].max() == 64, leaves


def test_json_tells_how_the_tree_came_about(whole):
    with open(whole[:-4] + ".json") as file:
        record = json.load(file)
    assert record["options"]["field"]["tree"] == "adaptive"
    updates = record["metrics"]["tree_updates"]
    assert [u["epoch"] for u in updates] == [2 * (i + 1) for i in range(len(updates))]
    assert updates[0]["splits"] > 0 and updates[0]["merges"] > 0
    assert updates[0]["predicted_error"] < updates[0]["error"]
    sizes = leaves_of(whole)[:, 2]
    assert updates[-1]["leaves_by_level"] == [int((sizes == s).sum()) for s in (64, 32, 16)]


def test_picture_shows_the_leaves(whole):
    picture = read_png(whole[:-4] + "_tree.png")
    zoom = picture.shape[1] // SIZE
    assert picture.shape == (SIZE * zoom, SIZE * zoom, 3)
    is_border = (picture == [255, 140, 0]).all(axis=2)[::-1]  # y upwards
    expected = np.zeros_like(is_border)
    for x0, y0, size in leaves_of(whole) * zoom:
        expected[y0, x0 : x0 + size] = expected[y0 : y0 + size, x0] = True
    assert (is_border == expected).all()


def test_budget_is_kept(command):
    output = fresh_output("budget")
    harness.succeed(*command(output, "--leaf-budget", 10))
    assert len(leaves_of(output)) <= 10
    result = harness.tomofield(*command(fresh_output("uniform"), "--tree", "uniform",
                                        "--leaf-budget", 10))
    assert result.returncode == 2 and "--leaf-budget" in result.stderr, result


def test_interrupted_runs_end_alike(command, whole):
    """Every run stops after another number of steps: before, between and after updates."""
    output = fresh_output("resumed")
    stops = []
    harness.finish_with_stops(command(output, "--resume"), lambda: stops.append(1), most=40)
    assert stops, "no run was caught"
    for extension in (".mrc", ".h5", "_tree.png"):
        assert harness.read_bytes(output[:-4] + extension) == harness.read_bytes(
            whole[:-4] + extension), extension
