"""Tests `tomofield export` and `tomofield info` on a model of a small reconstruction.

Volumes are read with mrcfile and compared with the reconstruction's own."""

import collections
import io
import os
import pathlib
import shutil
import signal
import subprocess
import time

import h5py
import mrcfile
import numpy as np
import pytest

import harness

PIXEL_A = 7.3
X0, Y0, WIDTH, HEIGHT, THICKNESS = 6, 4, 41, 37, 30
PART = (slice(5, 16), slice(8, 28), slice(3, 33))  # of the volume, [z, y, x]

Reconstruction = collections.namedtuple("Reconstruction", "folder volume")


@pytest.fixture(scope="module")
def reconstruction():
    """Returns the folder of volume.mrc and model.h5, and the values of the volume."""
    folder = harness.fresh_directory("reconstruction")
    series, output = os.path.join(folder, "series"), os.path.join(folder, "volume.mrc")
    harness.succeed("simulate", series, "--size", 56, "--thickness", THICKNESS, "--voxel-size",
                    PIXEL_A, "--tilts", "-60:60:10")
    harness.succeed("reconstruct", series + "/tilt_series.mrc", "--tlt", series + "/tilt_series.tlt",
                    "--contrast", "bright", "--thickness", THICKNESS, "--roi",
                    f"{X0},{Y0},{X0 + WIDTH},{Y0 + HEIGHT}", "--epochs", 1, "-o", output)
    os.rename(os.path.join(folder, "volume.h5"), os.path.join(folder, "model.h5"))
    volume = read(output)[0]
    assert volume.shape == (THICKNESS, HEIGHT, WIDTH)
    assert np.ptp(volume) > 0
    return Reconstruction(folder, volume)


@pytest.fixture(autouse=True)
def in_scratch(reconstruction, scratch, monkeypatch):
    """Runs every test in its own folder, with copies of the model and the volume."""
    monkeypatch.chdir(scratch)
    for name in ("model.h5", "volume.mrc"):
        shutil.copy(os.path.join(reconstruction.folder, name), scratch)


@pytest.fixture
def whole(reconstruction):
    return reconstruction.volume


def read(path):
    complaints = io.StringIO()
    assert mrcfile.validate(path, complaints), complaints.getvalue()
    with mrcfile.open(path) as volume:
        return np.array(volume.data), volume.voxel_size, volume.header.origin.tolist()


def export(*arguments):
    """Exports to box.mrc and returns its values, voxel size and origin."""
    harness.succeed("export", "model.h5", "-o", "box.mrc", "--overwrite", *arguments)
    return read("box.mrc")


def check_close(found, expected, whole):
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-6 * np.abs(whole).max())


def test_by_default_it_is_the_volume_of_reconstruct():
    export()
    assert pathlib.Path("box.mrc").read_bytes() == pathlib.Path("volume.mrc").read_bytes()


@pytest.mark.parametrize("box", (
    ["--box", f"{X0 + 3},{Y0 + 8},5,{X0 + 33},{Y0 + 28},16"],
    ["--center", f"{X0 + 18},{Y0 + 18},10.5", "--size", "30,20,11"]))
def test_a_part_knows_where_it_lies(whole, box):
    values, voxel_size, origin = export(*box)
    check_close(values, whole[PART], whole)
    np.testing.assert_allclose(origin, np.array([X0 + 3, Y0 + 8, 5]) * PIXEL_A, atol=1e-4)
    np.testing.assert_allclose(voxel_size.tolist(), PIXEL_A, rtol=1e-7)


def test_a_box_that_no_machine_samples_is_refused_before_the_work():
    result = harness.tomofield("export", "model.h5", "-o", "large.mrc", "--center", "0,0,0", "--size",
                               "16000000,16000000,4")
    assert result.returncode == 2 and "too large" in result.stderr
    assert not pathlib.Path("large.mrc").exists()


@pytest.mark.parametrize("size", ("20000,20000,10000", "1,1000000,1000000", "16000000,1,200000"))
def test_a_volume_larger_than_its_disk_is_refused_before_the_work(size):
    result = harness.tomofield("export", "model.h5", "-o", "large.mrc", "--center", "16,16,8", "--size",
                               size, timeout=60)
    assert result.returncode == 2 and "its disk has only" in result.stderr, result.stderr
    assert not pathlib.Path("large.mrc").exists()


def test_room_is_that_of_the_volume_and_its_zarr():
    """A plane ends in chunks of 64 voxels: the Zarr store is 64 times as large."""
    result = harness.tomofield("export", "model.h5", "-o", "plane.mrc", "--center", "16,16,8", "--size",
                               "60000,60000,1", "--zarr", timeout=60)
    assert result.returncode == 2 and "plane.zarr" in result.stderr and "its disk" in result.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_export_leaves_nothing(number, tmp_path):
    model = os.path.abspath("model.h5")
    run = harness.start("export", model, "-o", "long.mrc", "--center", "16,16,8", "--size",
                        "1500,1500,1500", "--rotate", "10,20,30", cwd=tmp_path)
    next(line for line in run.stderr if "may take about" in line)
    run.send_signal(number)
    _, said = run.communicate(timeout=60)
    assert run.returncode == 128 + number and "stopped; nothing was written" in said
    assert not [name for name in os.listdir(tmp_path) if "long" in name]


def test_a_stopped_simulation_leaves_nothing(tmp_path):
    run = harness.start("simulate", "series", "--size", 512, cwd=tmp_path)
    time.sleep(1)
    run.send_signal(signal.SIGTERM)
    _, said = run.communicate(timeout=60)
    assert run.returncode == 128 + signal.SIGTERM and "stopped; nothing was written" in said
    assert not any(os.scandir(tmp_path / "series")) if (tmp_path / "series").exists() else True


def test_a_long_export_says_how_long_before_the_work():
    command = [harness.PROGRAM, "export", "model.h5", "-o", "long.mrc", "--center", "16,16,8", "--size",
               "2000,2000,2000", "--rotate", "10,20,30"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        said = next((line for line in running.stderr if "may take about" in line), None)
        running.terminate()
        running.stderr.read()
    assert said and "2000 × 2000 × 2000 voxels" in said


def test_a_box_outside_the_region_of_interest_has_a_warning():
    for x1, is_outside in ((X0 + WIDTH, False), (X0 + WIDTH + 3, True)):
        result = harness.tomofield("export", "model.h5", "-o", "box.mrc", "--overwrite", "--box",
                                   f"{X0 + 3},{Y0 + 8},0,{x1},{Y0 + 10},5")
        assert ("reaches outside" in result.stderr) == is_outside, result.stderr


def test_binned_voxels_are_means(whole):
    values, voxel_size, _ = export("--bin", 2, "--box",
                                   f"{X0 + 3},{Y0 + 8},5,{X0 + 33},{Y0 + 28},15")
    means = whole[PART][:10].reshape(5, 2, 10, 2, 15, 2).mean(axis=(1, 3, 5))
    check_close(values, means, whole)
    np.testing.assert_allclose(voxel_size.tolist(), 2 * PIXEL_A, rtol=1e-7)
    # The odd last column and row stay out, half a pixel on either side.
    values, _, origin = export("--voxel-size", 2 * PIXEL_A)
    assert values.shape == (15, 18, 20)
    np.testing.assert_allclose(origin, np.array([X0 + 0.5, Y0 + 0.5, 0]) * PIXEL_A, atol=1e-4)


def test_a_size_that_the_header_has_rounded_is_that_of_the_pixels(tmp_path):
    """A header states the cell, so 7.3 Å come back as 7.2999998."""
    harness.succeed("simulate", tmp_path / "s", "--size", 61, "--thickness", 23, "--voxel-size", 7.3,
                    "--tilts=-60:60:12")
    harness.succeed("reconstruct", tmp_path / "s/tilt_series.mrc", "--tlt",
                    tmp_path / "s/tilt_series.tlt", "--thickness", 23, "--contrast", "bright",
                    "--no-margin", "--epochs", 1, "--coarse-epochs", 2, "--tv", 5, "--prior", "tv",
                    "--bead-diameter", 0, "-o", tmp_path / "s.mrc")
    for angpix, bin_factor in ((7.3, 1), (14.6, 2), (3.65, 0.5)):
        by_size, by_bin = tmp_path / "size.mrc", tmp_path / "bin.mrc"
        harness.succeed("export", tmp_path / "s.h5", "-o", by_size, "--angpix", angpix, "--overwrite")
        harness.succeed("export", tmp_path / "s.h5", "-o", by_bin, "--bin", bin_factor, "--overwrite")
        assert by_size.read_bytes() == by_bin.read_bytes(), angpix


def test_axes_rotation_and_sign(whole):
    # With IMOD's axes, trimvol -rx turns the sections back: z = rows - 1 - row.
    values = export("--axes", "xzy")[0]
    said = harness.succeed("export", "model.h5", "-o", "sizes.mrc", "--axes", "xzy").stdout
    assert " × ".join(map(str, values.shape[::-1])) + " voxels (x, z, y)" in said
    check_close(values[:, ::-1].transpose(1, 0, 2), whole, whole)
    # After a quarter turn about z (RELION's rot) the box's x lies along -y of the tomogram.
    values = export("--center", f"{X0 + 18},{Y0 + 18},10.5", "--size", "20,30,11", "--rotate",
                    "90,0,0")[0]
    check_close(values, whole[PART][:, ::-1, :].transpose(0, 2, 1), whole)
    check_close(export("--invert")[0], -whole, whole)


def test_modes_of_the_file(whole):
    halves = export("--mode", 12)[0]
    assert halves.dtype == np.float16
    np.testing.assert_allclose(halves, whole, rtol=1e-3, atol=1e-6)
    integers = export("--mode", 1)[0]
    assert integers.dtype == np.int16 and np.abs(integers).max() == 32000
    step = np.abs(whole).max() / 32000
    np.testing.assert_allclose(integers * step, whole, rtol=0, atol=0.51 * step)


def test_info_describes_the_model():
    text = harness.succeed("info", "model.h5").stdout
    with h5py.File("model.h5") as model:
        num_parameters = model["field/parameters"].size
    for fact in ("7.3 Å", f"{WIDTH} × {HEIGHT} px from {X0},{Y0}", "13 views from -60° to 60°",
                 "bright", f"{num_parameters} parameters", "root cells", "margin", '"epochs":1'):
        assert fact in text, (fact, text)


def expect_refusal(facts, *arguments, command="export"):
    before = {path: path.stat().st_mtime_ns for path in pathlib.Path(".").rglob("*")}
    result = harness.tomofield(command, *arguments)
    assert result.returncode == 2, (arguments, result.returncode, result.stdout, result.stderr)
    for fact in facts:
        assert fact in result.stderr, (arguments, fact, result.stderr)
    assert "HDF5:" not in result.stderr, result.stderr
    after = {path: path.stat().st_mtime_ns for path in pathlib.Path(".").rglob("*")}
    assert before.keys() == after.keys(), (arguments, before.keys() ^ after.keys())
    assert all(path.is_dir() or before[path] == after[path] for path in before), arguments


def test_options_that_make_no_sense_are_refused():
    export()
    expect_refusal(["box.mrc", "--overwrite"], "model.h5", "-o", "box.mrc")
    expect_refusal(["nowhere"], "model.h5", "-o", "nowhere/new.mrc")
    expect_refusal(["model.h5"], "model.h5", "-o", "./model.h5", "--overwrite")
    expect_refusal(["absent.h5"], "absent.h5", "-o", "new.mrc")
    expect_refusal(["volume.mrc", "HDF5"], "volume.mrc", "-o", "new.mrc")
    expect_refusal(["outside", "z runs"], "model.h5", "-o", "new.mrc", "--box", "0,0,100,9,9,110")
    expect_refusal(["--box", "y from 9 to 0"], "model.h5", "-o", "new.mrc", "--box", "0,9,0,9,0,9")
    expect_refusal(["--box"], "model.h5", "-o", "new.mrc", "--box", "0,0,0,9,9")
    expect_refusal(["nan"], "model.h5", "-o", "new.mrc", "--center", "1,nan,1", "--size", "3,3,3")
    expect_refusal(["--size"], "model.h5", "-o", "new.mrc", "--center", "1,1,1")
    expect_refusal(["--size"], "model.h5", "-o", "new.mrc", "--center", "1,1,1", "--size", "0,3,3")
    expect_refusal(["--voxel-size"], "model.h5", "-o", "new.mrc", "--voxel-size", "0")
    expect_refusal(["--bin"], "model.h5", "-o", "new.mrc", "--voxel-size", "9", "--bin", "2")
    expect_refusal(["--mode"], "model.h5", "-o", "new.mrc", "--mode", "4")
    expect_refusal(["--level"], "model.h5", "-o", "new.mrc", "--level", "")
    expect_refusal(["--zarr"], "model.h5", "-o", "new.mrc", "--zarr-version", "0.5")
    for words in (["--level", "3,2"], ["--rotate", "3,2,1"], ["--angpix", "5"]):
        expect_refusal(["--compact"], "model.h5", "--compact", "c.h5", *words)


def test_damaged_and_foreign_models_are_refused():
    whole_model = pathlib.Path("model.h5").read_bytes()
    for length in (9, 400, len(whole_model) // 2, len(whole_model) - 1):
        pathlib.Path("torn.h5").write_bytes(whole_model[:length])
        expect_refusal(["torn.h5"], "torn.h5", "-o", "new.mrc")
        expect_refusal(["torn.h5"], "torn.h5", command="info")
    zeroed = bytearray(whole_model)
    zeroed[len(zeroed) // 2:len(zeroed) // 2 + 4096] = bytes(4096)
    pathlib.Path("zeroed.h5").write_bytes(zeroed)
    expect_refusal(["zeroed.h5", "checksum"], "zeroed.h5", "-o", "new.mrc")
    with h5py.File("foreign.h5", "w") as foreign:
        foreign["voltage"] = 300.0
    expect_refusal(["foreign.h5", "no model of tomofield"], "foreign.h5", "-o", "new.mrc")
    expect_refusal(["foreign.h5", "no model of tomofield"], "foreign.h5", command="info")

    # HDF5 itself must stay silent about damaged metadata, too.
    damaged = bytearray(whole_model)
    damaged[whole_model.index(b"softplus_beta")] ^= 1
    pathlib.Path("damaged.h5").write_bytes(damaged)
    expect_refusal(["damaged.h5"], "damaged.h5", "-o", "new.mrc")
