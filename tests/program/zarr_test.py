"""Volumes as OME-Zarr: read by python3-zarr, and compared with the MRC file."""

import json
import os

import harness
import mrcfile
import numpy as np
import pytest
import zarr
from harness import PIXEL_SIZE

AXES = [{"name": axis, "type": "space", "unit": "angstrom"} for axis in "zyx"]


@pytest.fixture(scope="module")
def finished():
    return harness.Series("series").reconstruct("plain", "--zarr")


def export(finished, *options, name="box"):
    path = os.path.join(harness.SCRATCH, name)
    harness.succeed("export", finished.model_path, "-o", path + ".mrc", "--zarr", *options)
    with mrcfile.open(path + ".mrc") as file:
        return zarr.open(path + ".zarr", "r"), file.data.copy(), file.header.origin.tolist()


def halved(values):
    """Returns the means of 2 x 2 x 2 voxels; fewer at odd ends."""
    for axis in range(3):
        size = values.shape[axis]
        odd = np.take(values, [size - 1], axis) if size % 2 else np.take(values, [], axis)
        even = np.concatenate([values, odd], axis)
        first, second = (np.take(even, range(i, even.shape[axis], 2), axis) for i in (0, 1))
        values = (first + second) / 2
    return values


def test_reconstruct_writes_the_volume_beside_the_mrc_file(finished):
    group = zarr.open(finished.volume_path[:-4] + ".zarr", "r")
    np.testing.assert_array_equal(group["0"][:], finished.volume.astype(np.float32))
    assert group["0"].compressor is None and group["0"].dtype == np.float32
    assert not [name for name in os.listdir(os.path.dirname(finished.volume_path))
                if name.startswith(".")]


def test_levels_are_means_of_the_one_before(finished):
    group, values, origin = export(finished, "--center", "24,18,12", "--size", "131,70,65")
    (multiscale,) = group.attrs["multiscales"]
    assert multiscale["version"] == "0.4" and multiscale["axes"] == AXES
    paths = [dataset["path"] for dataset in multiscale["datasets"]]
    assert paths == ["0", "1", "2"]
    for level, dataset in enumerate(multiscale["datasets"]):
        array = group[dataset["path"]]
        assert array.shape == values.shape and array.chunks == (64, 64, 64)
        np.testing.assert_allclose(array[:], values, rtol=0, atol=2e-6 * np.abs(values).max())
        scale, translation = dataset["coordinateTransformations"]
        np.testing.assert_allclose(scale["scale"], 3 * [2 ** level * PIXEL_SIZE], rtol=1e-6)
        middle = np.array(origin[::-1]) + (2 ** level - 1) / 2 * PIXEL_SIZE
        np.testing.assert_allclose(translation["translation"], middle, rtol=1e-5, atol=1e-3)
        values = halved(values)


@pytest.mark.parametrize("kind, mode", (("float16", 12), ("int16", 1)))
def test_voxels_keep_their_type(finished, kind, mode):
    group, values, _ = export(finished, "--mode", mode, name=kind)
    assert group["0"].dtype == kind
    np.testing.assert_array_equal(group["0"][:], values)


def test_a_folder_is_replaced_as_a_whole_or_not_at_all(finished):
    path = os.path.join(harness.SCRATCH, "again")
    command = ["export", finished.model_path, "-o", path + ".mrc", "--zarr"]
    harness.succeed(*command, "--bin", 2)
    os.remove(path + ".mrc")
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "again.zarr' exists" in refused.stderr, refused.stderr
    harness.succeed(*command, "--overwrite")
    assert zarr.open(path + ".zarr", "r")["0"].shape == finished.volume.shape


@pytest.mark.parametrize("name", ("precious", ".zgroup", "zarr.json"))
def test_a_folder_of_something_else_stays(finished, name):
    folder = os.path.join(harness.SCRATCH, "other" + name)
    os.makedirs(folder + ".zarr")
    open(os.path.join(folder + ".zarr", name), "w").close()
    refused = harness.tomofield("export", finished.model_path, "-o", folder + ".mrc", "--zarr",
                                "--overwrite")
    assert refused.returncode == 2 and "no folder of such results" in refused.stderr
    assert os.listdir(folder + ".zarr") == [name] and not os.path.exists(folder + ".mrc")


def test_metadata_is_json_as_napari_reads_it(finished):
    folder = finished.volume_path[:-4] + ".zarr"
    with open(os.path.join(folder, ".zattrs"), encoding="utf-8") as file:
        attributes = json.load(file)
    assert attributes["multiscales"][0]["type"] == "mean"
    with open(os.path.join(folder, "0", ".zarray"), encoding="utf-8") as file:
        array = json.load(file)
    assert array["dimension_separator"] == "/" and array["order"] == "C"
    assert os.path.isfile(os.path.join(folder, "0/0/0/0"))
