"""Volumes as OME-Zarr: read by python3-zarr, and compared with the MRC file."""

import json
import os
import pathlib
import shutil

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


def test_a_link_to_a_store_is_called_one(finished):
    path = os.path.join(harness.SCRATCH, "linked")
    command = ["export", finished.model_path, "--zarr", "--overwrite", "-o"]
    harness.succeed(*command, path + ".mrc")
    os.symlink(path + ".zarr", path + "_2.zarr")
    refused = harness.tomofield(*command, path + "_2.mrc")
    assert refused.returncode == 2 and "linked_2.zarr': it is a symbolic link" in refused.stderr
    assert os.path.islink(path + "_2.zarr")


@pytest.mark.parametrize("version", ("0.4", "0.5"))
def test_a_store_into_which_others_put_something_stays(finished, version):
    """Viewers write labels into the store that they show."""
    path = os.path.join(harness.SCRATCH, "labelled" + version)
    command = ["export", finished.model_path, "-o", path + ".mrc", "--zarr", "--zarr-version", version,
               "--overwrite"]
    harness.succeed(*command)
    harness.succeed(*command)
    os.mkdir(path + ".zarr/labels")
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "'labels'" in refused.stderr, refused.stderr
    os.rmdir(path + ".zarr/labels")
    shutil.copytree(path + ".zarr", path + ".pristine")
    chunks = "0/c" if version == "0.5" else "0"
    other = "0/.zarray" if version == "0.5" else "0/zarr.json"
    for foreign in ("0/notes.txt", "0/0/notes.txt", "9/thesis.mrc", "9/.zarray", "0/labels/a", other,
                    f"{chunks}/0/0/99", f"{chunks}/99/0/0", f"{chunks}/0/0/00"):
        os.makedirs(os.path.dirname(f"{path}.zarr/{foreign}"), exist_ok=True)
        open(f"{path}.zarr/{foreign}", "w", encoding="utf-8").close()
        refused = harness.tomofield(*command)
        assert refused.returncode == 2 and "tomofield has not made" in refused.stderr, foreign
        assert os.path.isfile(f"{path}.zarr/{foreign}")
        shutil.rmtree(path + ".zarr")
        shutil.copytree(path + ".pristine", path + ".zarr")
    os.remove(f"{path}.zarr/{chunks}/0/0/0")
    os.mkfifo(f"{path}.zarr/{chunks}/0/0/0")
    assert "tomofield has not made" in harness.tomofield(*command).stderr
    os.remove(f"{path}.zarr/{chunks}/0/0/0")
    marker = pathlib.Path(f"{path}.zarr/.tomofield")
    written = marker.read_bytes()
    marker.write_bytes(b"")
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "does not show that tomofield wrote it" in refused.stderr, refused.stderr
    marker.write_bytes(written)
    harness.succeed(*command)
    plain = [word for word in command if not word.startswith("--zarr") and word != version]
    assert "is not of the new" in harness.succeed(*plain).stderr


def test_an_input_within_a_store_is_an_input(finished, tmp_path):
    command = ["export", finished.model_path, "-o", tmp_path / "out.mrc", "--zarr", "--overwrite"]
    harness.succeed(*command)
    points = tmp_path / "out.zarr/0/0/0/0"
    config = tmp_path / "link.txt"
    config.symlink_to(points)
    points.write_text("", "utf-8")
    refused = harness.tomofield(*command, "--config", config)
    assert refused.returncode == 2 and "the input" in refused.stderr, refused
    assert points.read_bytes() == b""


def test_a_store_is_replaced_beside_other_files_of_a_run_and_by_a_batch(tmp_path):
    """A store is a folder, which no check of the other files takes for a file that cannot be written."""
    harness.succeed("simulate", "s", "--size", 32, "--thickness", 16, cwd=tmp_path)
    options = ["--thickness", 16, "--contrast", "bright", "--no-margin", "--epochs", 2, "--tv", 5,
               "--coarse-epochs", 2, "--prior", "tv", "--zarr", "--overwrite"]
    series = ["s/tilt_series.mrc", "--tlt", "s/tilt_series.tlt"]
    for extra in ([], ["--trace", "t.json"], ["--plan", "p.json"]):
        harness.succeed("reconstruct", *series, *options, "-o", "a.mrc", *extra, cwd=tmp_path)
    for flag in ("--trace", "--plan", "--choice", "--grid"):  # no result of the run itself
        refused = harness.tomofield("reconstruct", *series, *options, "-o", "a.mrc", flag, "a.mrc",
                                    *(["--dry-run"] if flag == "--grid" else []), cwd=tmp_path)
        assert refused.returncode == 2 and "two results would both be" in refused.stderr, refused
    (tmp_path / "list.csv").write_text("stack,tlt\ns/tilt_series.mrc,s/tilt_series.tlt\n", "utf-8")
    for _ in range(2):
        harness.succeed("batch", "list.csv", *options, "-o", "out", cwd=tmp_path)


# Debian's python3-zarr does not know the final version 3, so this reads it by the specification
# (zarr-specs.readthedocs.io, core specification of version 3; ngff.openmicroscopy.org 0.5).

def read_node(folder, kind):
    with open(os.path.join(folder, "zarr.json"), encoding="utf-8") as file:
        node = json.load(file)
    assert node["zarr_format"] == 3 and node["node_type"] == kind
    known = {"zarr_format", "node_type", "attributes"}
    if kind == "array":
        known |= {"shape", "data_type", "chunk_grid", "chunk_key_encoding", "codecs", "fill_value",
                  "dimension_names", "storage_transformers"}
        assert {"shape", "data_type", "chunk_grid", "chunk_key_encoding", "codecs",
                "fill_value"} <= set(node)
    # A reader must fail on a member that it does not know.
    assert set(node) <= known, set(node) - known
    return node


def read_array_3(folder):
    """Returns the values of an array of version 3, and its description."""
    node = read_node(folder, "array")
    shape = node["shape"]
    assert node["chunk_grid"]["name"] == "regular"
    chunk = node["chunk_grid"]["configuration"]["chunk_shape"]
    assert len(chunk) == len(shape) == len(node["dimension_names"])
    assert node["data_type"] in ("float32", "float16", "int16")
    assert node["chunk_key_encoding"]["name"] == "default"
    separator = node["chunk_key_encoding"].get("configuration", {}).get("separator", "/")
    (codec,) = node["codecs"]
    assert codec["name"] == "bytes" and codec["configuration"]["endian"] == "little"
    kind = np.dtype(node["data_type"]).newbyteorder("<")
    padded = np.full([-(-n // c) * c for n, c in zip(shape, chunk)], node["fill_value"], kind)
    for place in np.ndindex(*(n // c for n, c in zip(padded.shape, chunk))):
        key = separator.join(["c", *map(str, place)])
        values = np.frombuffer(harness.read_bytes(os.path.join(folder, key)), kind).reshape(chunk)
        padded[tuple(slice(p * c, (p + 1) * c) for p, c in zip(place, chunk))] = values
    return padded[tuple(slice(n) for n in shape)], node


@pytest.mark.parametrize("mode, kind", ((2, "float32"), (12, "float16"), (1, "int16")))
def test_version_0_5_is_a_group_of_zarr_3(finished, mode, kind):
    name = os.path.join(harness.SCRATCH, "third")
    harness.succeed("export", finished.model_path, "-o", name + ".mrc", "--zarr", "--zarr-version",
                    "0.5", "--mode", mode, "--center", "24,18,12", "--size", "131,70,65")
    with mrcfile.open(name + ".mrc") as file:
        values, origin = file.data.copy(), file.header.origin.tolist()
    group = read_node(name + ".zarr", "group")
    assert set(group["attributes"]) == {"ome"}
    ome = group["attributes"]["ome"]
    assert ome["version"] == "0.5"
    (multiscale,) = ome["multiscales"]
    assert "version" not in multiscale and multiscale["axes"] == AXES
    assert [dataset["path"] for dataset in multiscale["datasets"]] == ["0", "1", "2"]
    for level, dataset in enumerate(multiscale["datasets"]):
        found, node = read_array_3(os.path.join(name + ".zarr", dataset["path"]))
        assert node["data_type"] == kind and node["dimension_names"] == ["z", "y", "x"]
        tolerance = 1 if kind == "int16" else (1e-3 if mode == 12 else 2e-6) * np.abs(values).max()
        np.testing.assert_allclose(found, values, rtol=0, atol=tolerance if level else 0)
        scale, translation = dataset["coordinateTransformations"]
        np.testing.assert_allclose(scale["scale"], 3 * [2 ** level * PIXEL_SIZE], rtol=1e-6)
        middle = np.array(origin[::-1]) + (2 ** level - 1) / 2 * PIXEL_SIZE
        np.testing.assert_allclose(translation["translation"], middle, rtol=1e-5, atol=1e-3)
        values = halved(found.astype(np.float64))


def test_both_versions_hold_the_same_and_replace_each_other(finished):
    path = os.path.join(harness.SCRATCH, "either")
    command = ["export", finished.model_path, "-o", path + ".mrc", "--zarr", "--overwrite"]
    harness.succeed(*command)
    second = zarr.open(path + ".zarr", "r")["0"][:]
    harness.succeed(*command, "--zarr-version", "0.5")
    np.testing.assert_array_equal(read_array_3(path + ".zarr/0")[0], second)
    assert not os.path.exists(path + ".zarr/.zgroup")
    harness.succeed(*command)
    assert not os.path.exists(path + ".zarr/zarr.json")
    refused = harness.tomofield(*command, "--zarr-version", "0.6")
    assert refused.returncode == 2 and "--zarr-version" in refused.stderr


def test_metadata_is_json_as_napari_reads_it(finished):
    folder = finished.volume_path[:-4] + ".zarr"
    with open(os.path.join(folder, ".zattrs"), encoding="utf-8") as file:
        attributes = json.load(file)
    assert attributes["multiscales"][0]["type"] == "mean"
    with open(os.path.join(folder, "0", ".zarray"), encoding="utf-8") as file:
        array = json.load(file)
    assert array["dimension_separator"] == "/" and array["order"] == "C"
    assert os.path.isfile(os.path.join(folder, "0/0/0/0"))
