"""Tests reconstruct from end to end: the files that it writes and the effects of its options."""

import fcntl
import io
import json
import os
import pty
import re
import signal
import struct
import termios
import time

import h5py
import mrcfile
import numpy as np
import pytest
import skimage.io

import harness
from harness import HEIGHT, PIXEL_SIZE, THICKNESS, TILTS, WIDTH, psnr, read_bytes, read_volume


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module")
def plain(series):
    """Returns the results of QUICK options alone."""
    return series.reconstruct("plain")


def test_volume_is_an_mrc_file_that_others_read(plain):
    report = io.StringIO()
    assert mrcfile.validate(plain.volume_path, print_file=report), report.getvalue()
    with mrcfile.open(plain.volume_path) as file:
        header, data = file.header, file.data
        assert data.shape == (THICKNESS, HEIGHT, WIDTH) and data.dtype == np.float32
        assert file.is_volume() and header.ispg == 1 and header.nsymbt == 0
        for axis, size in zip("xyz", (WIDTH, HEIGHT, THICKNESS)):
            # The size in Å is exact to float32.
            assert header.cella[axis] == np.float32(size * PIXEL_SIZE), (axis, header.cella)
            assert header["m" + axis] == size
        assert (header.mapc, header.mapr, header.maps) == (1, 2, 3)
        assert header.dmin == data.min() and header.dmax == data.max()
        values = data.astype(np.float64)
        np.testing.assert_allclose(header.dmean, values.mean(), rtol=1e-6)
        np.testing.assert_allclose(header.rms, values.std(), rtol=1e-5)
        assert header.label[0].startswith(b"tomofield"), header.label[0]


def test_specimen_is_found(series):
    flat = psnr(np.full_like(series.truth, series.truth.mean()), series.truth)
    for field in ("vm", "grid"):
        volume = series.reconstruct(field, "--field", field, "--epochs", 16).volume
        gain = psnr(volume, series.truth) - flat
        correlation = np.corrcoef(volume.ravel(), series.truth.ravel())[0, 1]
        print(f"{field}: {gain:.2f} dB above a flat volume, correlation {correlation:.3f}")
        assert gain > 3 and correlation > 0.7, (field, gain, correlation)


def test_json_has_metrics_and_every_option(plain, series):
    record = json.load(open(plain.json_path))
    assert re.fullmatch(r"\d+\.\d+\.\d+", record["tomofield"])
    options, metrics = record["options"], record["metrics"]
    assert options["input"]["stack"] == series.stack and options["input"]["tlt"] == series.tlt
    assert options["input"]["contrast"] == "bright" and options["input"]["bin"] == 1
    assert options["specimen"]["thickness"] == THICKNESS and options["specimen"]["hand"] == 1
    assert options["field"]["kind"] == "vm" and options["field"]["with_margin"] is False
    assert options["fit"]["epochs"] == 8 and options["fit"]["seed"] == 1
    assert options["volume"] == {"mode": 2, "axes": "xyz", "invert": False,
                                 "denoising_halves": False}
    assert metrics["steps"] == 8 * 7 and metrics["size_px"] == [WIDTH, HEIGHT, THICKNESS]
    assert abs(metrics["pixel_size_A"] - PIXEL_SIZE) < 1e-5
    residuals = metrics["mean_squared_residual_per_noise_variance"]
    assert len(residuals) == 8 and residuals[-1] < residuals[0]
    np.testing.assert_allclose([view["tilt_deg"] for view in metrics["views"]], TILTS)


def test_model_is_readable_with_h5py(plain):
    with h5py.File(plain.model_path) as model:
        assert model.attrs["format"] == b"tomofield model"
        parameters = model["field/parameters"][:]
        assert parameters.size == json.load(open(plain.json_path))["metrics"]["parameters"]
        assert np.isfinite(parameters).all() and parameters.std() > 0
        np.testing.assert_allclose(model["geometry/tilt_deg"][:], TILTS)
        options = json.loads(model.attrs["options_json"])
        assert options == json.load(open(plain.json_path))["options"]
        # A finished model has no optimiser's moments, which would triple the file.
        assert "adam_m" not in model["training/floats"]


def test_pictures_show_the_slices(plain):
    volume = plain.volume
    slices = {"xy": volume[THICKNESS // 2], "xz": volume[:, HEIGHT // 2],
              "yz": volume[:, :, WIDTH // 2]}
    for plane, path in plain.pictures.items():
        picture = skimage.io.imread(path).astype(float)
        height, width = slices[plane].shape
        zoom = picture.shape[1] // width
        assert picture.shape == (height * zoom, width * zoom), (plane, picture.shape)
        assert picture.std() > 20, (plane, picture.std())
        # The second axis points upwards on the page.
        pixels = picture[zoom // 2 :: zoom, zoom // 2 :: zoom][::-1]
        assert np.corrcoef(pixels.ravel(), slices[plane].ravel())[0, 1] > 0.98, plane


def test_same_seed_same_bytes_whatever_the_threads(plain, series):
    def with_environment(name, threads, *options):
        env = dict(os.environ, OMP_NUM_THREADS=str(threads))
        return series.reconstruct(name, *options, env=env)

    one, two = with_environment("one", 1), with_environment("two", 2)
    assert one.same_as(two) and one.same_as(plain)
    three = with_environment("three", 1, "--threads", 3)
    assert one.same_as(three)
    assert json.load(open(three.json_path))["metrics"]["threads"] == 3
    other = series.reconstruct("other", "--seed", 2)
    assert not plain.same_as(other)
    copies = [os.path.join(harness.fresh_directory("copies"), f"{n}.mrc") for n in (1, 2)]
    for threads, copy in enumerate(copies, start=1):
        harness.succeed("export", plain.model_path, "-o", copy, "--threads", threads)
    assert read_bytes(copies[0]) == read_bytes(copies[1]) == read_bytes(plain.volume_path)
    for command in ("reconstruct", "export", "simulate", "baseline sirt"):
        for threads in (0, -1, 1025, "many"):
            result = harness.tomofield(*command.split(), "--threads", threads)
            assert result.returncode == 2 and "--threads" in result.stderr, result


def test_dark_contrast_is_the_inverted_density(plain, series):
    dark = series.with_views("dark", 50 - series.views)
    dark_options = ["--contrast", "dark", "--view-scale", "off", "--activation", "softplus"]
    found = dark.reconstruct("dark", *dark_options).volume
    # Dense is low and empty regions are 0, because the cell leaves the empty beam free.
    np.testing.assert_allclose(-found, plain.volume, atol=0.03)
    inverted = dark.reconstruct("inverted", *dark_options, "--invert").volume
    np.testing.assert_array_equal(inverted, -found)
    np.testing.assert_array_equal(series.reconstruct("negative", "--invert").volume, -plain.volume)
    # The data need no per-view scales and offsets, and fitting them does little harm.
    fitted = dark.reconstruct("fitted", "--contrast", "dark").volume
    assert np.corrcoef(fitted.ravel(), plain.volume.ravel())[0, 1] < -0.9


def test_modes_of_the_file(plain, series):
    exact = plain.volume
    for mode, kind in ((1, np.int16), (12, np.float16)):
        results = series.reconstruct("mode", "--mode", mode)
        assert mrcfile.validate(results.volume_path, print_file=io.StringIO())
        with mrcfile.open(results.volume_path) as file:
            assert file.data.dtype == kind
            stored, label = file.data.astype(np.float64), file.header.label[0].decode()
        if mode == 1:
            factor = float(re.search(r"stored = (\S+) x value", label)[1])
            assert 31990 <= abs(stored).max() <= 32000
            np.testing.assert_allclose(stored, exact * factor, atol=0.51, rtol=1e-5)
        else:
            np.testing.assert_allclose(stored, exact, rtol=6e-4, atol=1e-7)


def test_axes(plain, series):
    xzy = series.reconstruct("xzy", "--axes", "xzy").volume
    # IMOD's tilt writes this order: trimvol -rx turns rows (x, z) into sections from the last row on.
    np.testing.assert_array_equal(xzy[:, ::-1].transpose(1, 0, 2), plain.volume)


def test_region_of_interest_has_its_size(series):
    results = series.reconstruct("roi", "--roi", "5,3,40,30")
    with mrcfile.open(results.volume_path) as file:
        assert file.data.shape == (THICKNESS, 27, 35)
        # MRC2014: where the part begins. IMOD has the other sign, and bit 2 of its flags says so.
        np.testing.assert_allclose(file.header.origin.tolist(),
                                   (5 * PIXEL_SIZE, 3 * PIXEL_SIZE, 0), rtol=1e-6)
        stamp, flags = np.frombuffer(read_bytes(results.volume_path)[152:160], "<i4")
        assert stamp == 1146047817 and flags & 4
        labels = [label.decode().strip() for label in file.header.label[:file.header.nlabl]]
        assert labels[0].startswith("tomofield ") and "density field" in labels[0]
        assert labels[1:] == ["series: series.mrc", "angles: series.tlt"]
    assert json.load(open(results.json_path))["options"]["specimen"]["roi"] == [5, 3, 40, 30]


def test_binning(series):
    for options in (["--bin", 2], ["--angpix", 2 * PIXEL_SIZE]):
        results = series.reconstruct("bin", *options)
        with mrcfile.open(results.volume_path) as file:
            assert file.data.shape == (THICKNESS // 2, HEIGHT // 2, WIDTH // 2)
            assert abs(file.voxel_size.x / (2 * PIXEL_SIZE) - 1) < 1e-6
            binned = file.data.astype(np.float64)
        half = series.truth.reshape(THICKNESS // 2, 2, HEIGHT // 2, 2, WIDTH // 2, 2)
        half = half.mean((1, 3, 5))
        assert np.corrcoef(binned.ravel(), half.ravel())[0, 1] > 0.7
        # A density counts per pixel, so a pixel of twice the length has twice the value.
        assert abs(binned.mean() / half.mean() / 2 - 1) < 0.1


def test_excluded_views_do_not_count(series):
    excluded = [0, 6, 7]
    views = series.views.copy()
    views[excluded] = np.nan
    broken = series.with_views("broken", views)
    results = broken.reconstruct("excluded", "--exclude", "1,7-8")
    record = json.load(open(results.json_path))["metrics"]["views"]
    np.testing.assert_allclose([view["tilt_deg"] for view in record], np.delete(TILTS, excluded))
    fewer = series.with_views("fewer", np.delete(views, excluded, axis=0),
                              np.delete(TILTS, excluded))
    np.testing.assert_array_equal(fewer.reconstruct("without").volume, results.volume)


def test_config_file(plain, series):
    directory = harness.fresh_directory("config")

    def write(text):
        path = os.path.join(directory, "options.toml")
        with open(path, "w") as file:
            file.write(text)
        return path

    config = write('thickness = 24\ncontrast = "bright"\nno-margin = true\nfield = "vm"\nleaf-size = 16\n'
                   'rank = 6\nepochs = 3 # fewer\nsubsets = 7\nroi = [0, 0, 48, 36]\n'
                   'tv-penalty = "concave"\n'
                   'overwrite = false\n')
    output = os.path.join(directory, "out.mrc")
    harness.succeed("reconstruct", *series.input, "-o", output, "--config", config, "--epochs", 8)
    # The command line's epochs win, and a region of the whole view is the default.
    np.testing.assert_array_equal(read_volume(output), plain.volume)
    before = {name: read_bytes(os.path.join(directory, name)) for name in os.listdir(directory)}

    for text, words in (
        ("thickness = 24\nthicknes = 24", ["line 2", "thicknes"]),
        ("[fit]\nepochs = 3", ["line 1", "fit"]),
        ('thickness = "thick"', ["--thickness", "thick"]),
        ("thickness = true", ["line 1", "thickness"]),
        ("thickness = 24\noverwrite = 1", ["line 2", "overwrite", "true or false"]),
        ("thickness = 1979-05-27", ["line 1", "thickness"]),
        ("thickness = 24\nepochs = [1, 2]", ["epochs"]),
        ("thickness = ", ["line 1"]),
        ("config = 'other.toml'", ["config"]),
        ("help = true", ["help"]),
    ):
        result = harness.tomofield("reconstruct", *series.input, "-o", output + ".mrc",
                                   "--config", write(text))
        assert result.returncode == 2 and len(result.stderr.splitlines()) == 1, (text, result)
        for word in words:
            assert word in result.stderr, (text, result.stderr)
    for arguments in (["--config", "/nowhere.toml"], ["--config"], ["--config", directory],
                      ["--config", config, f"--config={config}"]):
        result = harness.tomofield("reconstruct", *series.input, "-o", output + ".mrc", *arguments)
        assert result.returncode == 2 and "--config" in result.stderr, (arguments, result)
    for name in before:
        if name != "options.toml":
            assert read_bytes(os.path.join(directory, name)) == before[name]
    assert sorted(os.listdir(directory)) == sorted(before)


def test_dry_run_writes_nothing_and_knows_the_memory(check_memory):
    check_memory("--rank", 256)
    # Plain vertices need most memory, in the first two stages.
    check_memory("--rank", 2, "--vertex-spacing", 0.25, "--vertex-epochs", 1)
    # A tree that is fitted for one epoch does not change.
    check_memory("--rank", 160, "--tree", "adaptive")
    check_memory("--field", "grid", "--engine", "ray", "--ray-samples", 8000)


@pytest.fixture(scope="module", name="check_memory")
def make_check_memory(series):
    def check_memory(*field):
        directory = harness.fresh_directory("dry")
        options = harness.merge(harness.QUICK, ["--epochs", 1, "--subsets", 1, *field,
                                                "--checkpoint-minutes", 0])
        arguments = ["reconstruct", *series.input, "-o", os.path.join(directory, "out.mrc"), *options]
        plan = harness.succeed(*arguments, "--dry-run").stdout
        assert os.listdir(directory) == []
        assert f"{len(TILTS)} views of {WIDTH} × {HEIGHT} pixels" in plan, plan
        assert f"tomogram {WIDTH} × {HEIGHT} × {THICKNESS} voxels" in plan, plan
        estimate = 1024 * float(re.search(r"about ([\d.]+) GiB of memory", plan)[1])
        if harness.is_sanitized():
            return
        status, text, measured = harness.run_measured(*arguments)
        assert status == 0, text
        print(f"memory: {estimate:.0f} MiB estimated, {measured:.0f} MiB measured")
        assert 0.8 < estimate / measured < 1.25, (estimate, measured)

    return check_memory


def test_plain_progress_lines_without_a_terminal(series):
    output = os.path.join(harness.fresh_directory("lines"), "out.mrc")
    run = harness.start("reconstruct", *series.input, "-o", output,
                        *harness.merge(harness.QUICK, ["--epochs", 100000, "--threads", 1]))
    lines, times = [], []
    while len(lines) < 2:
        line = run.stderr.readline()
        assert line, "the run ended"
        if line.startswith("reconstruct"):
            lines.append(line)
            times.append(time.monotonic())
    run.send_signal(signal.SIGINT)
    run.communicate()
    assert 2 < times[1] - times[0] < 30, times
    for line in lines:
        assert "\r" not in line and "\033" not in line, line
    # A line has progress, loss (after the first epoch), rate and time left.
    assert re.fullmatch(r"reconstruct +\d+ %  epoch \d+/100000  loss \d\.\d+  [\d.]+ steps/s"
                        r"  (\d+ h \d\d min|\d+ min \d\d s|\d+ s) left\n", lines[1]), lines[1]


def test_bar_on_a_terminal(series):
    for columns in (100, 60, 20):
        output = os.path.join(harness.fresh_directory("bar"), "out.mrc")
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        run = harness.subprocess.Popen(
            [harness.PROGRAM, *map(str, ["reconstruct", *series.input, "-o", output,
                                         *harness.QUICK])],
            stdout=harness.subprocess.DEVNULL, stderr=slave)
        os.close(slave)
        shown = b""
        while True:
            try:
                piece = os.read(master, 1 << 16)
            except OSError:  # the other end is closed
                break
            if not piece:
                break
            shown += piece
        os.close(master)
        assert run.wait() == 0
        bar = shown.decode().split("verdict:")[0]  # which comes after the bar
        draws = [draw for draw in bar.split("\r\033[K") if draw.startswith("reconstr")]
        assert len(draws) >= 2, shown
        for draw in draws:
            assert len(draw.rstrip("\r\n")) < columns, draw  # a longer line would wrap
        assert draws[-1].endswith("\n") and not any("\n" in draw for draw in draws[:-1]), draws
        if columns == 100:
            assert "[########################] 100 %" in draws[-1], draws[-1]
            assert "[......" in draws[0] and " loss " in draws[0] and " left" in draws[0], draws[0]
