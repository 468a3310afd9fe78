"""tomofield.Model gives points, boxes and tilted planes, as `tomofield export` does."""

import _thread
import os
import pathlib
import subprocess
import sys
import threading
import time

import mrcfile
import numpy as np
import pytest

import tomofield


@pytest.fixture(scope="module")
def model(series):
    return tomofield.Model(series.folder / "tomogram.h5")


def test_the_region_is_the_tomogram(series, model):
    region = model.region()
    assert region == tomofield.Box((16.0, 16.0, 8.0), (32, 32, 16))
    np.testing.assert_array_equal(model.sample(region), series.tomogram)
    voxel_A = float(mrcfile.open(series.folder / "tomogram.mrc").voxel_size.x)
    assert model.pixel_size_A == pytest.approx(voxel_A)


def test_points_are_voxels(series, model):
    z, y, x = np.mgrid[0:16, 0:32, 0:32]
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3) + 0.5
    np.testing.assert_allclose(model.sample_points(points).reshape(16, 32, 32), series.tomogram,
                               atol=1e-5 * np.abs(series.tomogram).max())
    assert model.sample_points([[-1000, 0, 0]]) == [0]
    assert model.sample_points(np.empty((0, 3))).shape == (0,)


def test_a_tilted_plane_is_a_box_of_one_voxel(model):
    plane = tomofield.Box((16, 16, 8), (11, 9, 1), euler_deg=(0, 30, 0))
    values = model.sample(plane)
    assert values.shape == (1, 9, 11)
    # About y: the box's x runs along cos x + sin z of the model.
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    along = np.arange(11) - 5.0
    points = [(16 + c * u, 16 + v, 8 + s * u) for v in np.arange(9) - 4.0 for u in along]
    np.testing.assert_allclose(values[0].ravel(), model.sample_points(points),
                               atol=1e-5 * np.abs(values).max())


def test_a_turned_box_is_what_export_writes(series, model):
    series.run("export", "tomogram.h5", "-o", "box.mrc", "--voxel-size",
               float(2 * model.pixel_size_A))
    box = model.region(voxel_px=2.0)
    np.testing.assert_array_equal(model.sample(box), mrcfile.read(series.folder / "box.mrc"))


def test_boxes_lie_in_the_tomogram_whose_x_axis_tilt_is_turned_back(series, tmp_path):
    """A part that is cut out lies where it is in the volume that reconstruct writes."""
    series.run("reconstruct", "s.mrc", "--tlt", "s.tlt", "--thickness", 16, "--contrast", "bright",
               "--no-margin", "--x-axis-tilt", 9, "--epochs", 2, "--coarse-epochs", 4, "-o", "leaning.mrc")
    whole = mrcfile.read(series.folder / "leaning.mrc")
    leaning = tomofield.Model(series.folder / "leaning.h5")
    assert leaning.region() == tomofield.Box((16.0, 16.0, 8.0), (32, 32, 16))
    close = {"atol": 1e-4 * np.abs(whole).max(), "rtol": 0}
    np.testing.assert_allclose(leaning.sample(leaning.region()), whole, **close)
    z, y, x = np.mgrid[4:12, 17:23, 5:25]
    part = whole[4:12, 17:23, 5:25]
    box = tomofield.Box((15, 20, 8), (20, 6, 8))
    np.testing.assert_allclose(leaning.sample(box), part, **close)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3) + 0.5
    np.testing.assert_allclose(leaning.sample_points(points).reshape(part.shape), part, **close)
    tomofield.export(leaning, tmp_path / "box.mrc", box=box)
    series.run("export", "leaning.h5", "--box", "5,17,4,25,23,12", "-o", "corners.mrc")
    series.run("export", "leaning.h5", "--center", "15,20,8", "--size", "20,6,8", "--rotate", "0,0,0",
               "-o", "center.mrc")
    for file in (tmp_path / "box.mrc", series.folder / "corners.mrc", series.folder / "center.mrc"):
        with mrcfile.open(file) as found:
            np.testing.assert_allclose(found.data, part, **close)
            origin = [float(found.header.origin[axis]) for axis in "xyz"]
            labels = [bytes(label).decode() for label in found.header.label]
        np.testing.assert_allclose(origin, np.array([5, 17, 4]) * leaning.pixel_size_A, rtol=1e-5)
        assert not any("turned: " in label for label in labels), labels
    with pytest.raises(subprocess.CalledProcessError) as refused:
        series.run("evaluate", "leaning.mrc", "--series", "s.mrc", "--tlt", "s.tlt", "--contrast", "bright")
    assert "x-axis tilt of the series is turned back in 'leaning.mrc'" in refused.value.stderr


def test_bad_input_is_refused_in_a_sentence(series, model):
    with pytest.raises(tomofield.Error, match="absent.h5"):
        tomofield.Model("absent.h5")
    with pytest.raises(tomofield.Error, match="box of 0"):
        model.sample(tomofield.Box((0, 0, 0), (0, 1, 1)))
    for size in ((2**21, 2**21, 2**22), (2**62, 4, 4), (4, 1, 2**62)):
        with pytest.raises(tomofield.Error, match="too large"):
            model.sample(tomofield.Box((0, 0, 0), size))
    large = tomofield.Box((0, 0, 0), (20000, 20000, 20000))
    with pytest.raises(tomofield.Error, match="29802.3 GiB of memory"):
        model.sample(large)
    with pytest.raises(tomofield.Error, match="its disk has only"):
        tomofield.export(model, series.folder / "large.mrc", box=large)
    with pytest.raises(tomofield.Error, match="N rows"):
        model.sample_points([1, 2, 3])
    with pytest.raises(tomofield.Error, match="finite"):
        model.sample_points([[1, 2, np.nan]])


def test_ctrl_c_stops_a_long_sampling(model):
    timer = threading.Timer(1, _thread.interrupt_main)
    timer.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        model.sample(tomofield.Box((16, 16, 8), (700, 700, 700), euler_deg=(10, 20, 30)))
    assert time.monotonic() - begun < 20
    timer.join()


def cost(call, seconds=None):
    """Returns the processor time of a call, which Ctrl-C ends after some seconds if they are given."""
    begun = time.process_time()
    if seconds is None:
        call()
        return time.process_time() - begun
    timer = threading.Timer(seconds, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call()
    timer.join()
    return time.process_time() - begun


def test_ctrl_c_stops_the_sampling_of_many_points(model):
    points = np.full((1 << 23, 3), 8.0)
    whole = cost(lambda: model.sample_points(points))
    assert cost(lambda: model.sample_points(points), 0.05) < whole / 2


def test_ctrl_c_stops_before_there_is_memory_for_a_large_box(model):
    box = tomofield.Box((16, 16, 8), (1200, 1200, 200))
    whole = cost(lambda: model.sample(box))
    assert cost(lambda: model.sample(box), 0.05) < whole / 2


def test_threads_export_at_the_same_time(model, tmp_path):
    """The results of one thread are not those of another."""
    failures = []

    def export(name):
        try:
            for _ in range(20):
                tomofield.export(model, tmp_path / name, overwrite=True)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=export, args=(f"{i}.mrc",)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures, failures
    assert sorted(path.name for path in tmp_path.glob("*.mrc")) == [f"{i}.mrc" for i in range(4)]


def test_the_number_of_threads_stays_while_a_thread_computes(series):
    """Each thread of the work has a buffer of its own, so no other number may come between."""
    script = f"""
import threading, tomofield
model = tomofield.Model({str(series.folder / "tomogram.h5")!r})
refused, done = [], []
def work():
    for _ in range(30):
        model.sample(model.region())
    done.append(True)
threads = [threading.Thread(target=work) for _ in range(2)]
for thread in threads: thread.start()
count = 0
while any(thread.is_alive() for thread in threads):
    count += 1
    try: tomofield.set_thread_count(1 + count % 3)
    except tomofield.Error as error: refused.append(str(error))
for thread in threads: thread.join()
tomofield.set_thread_count(2)
assert len(done) == 2 and refused and "set it before or after" in refused[0], (done, refused)

def told(progress):
    tomofield.set_thread_count(1)
try:
    tomofield.reconstruct({str(series.folder / "s.mrc")!r}, tlt={str(series.folder / "s.tlt")!r}, thickness=16,
                          contrast="bright", with_margin=False, epochs=1, progress=told)
except tomofield.Error as error: print(error)
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300,
                           env={**os.environ, "PYTHONPATH": str(pathlib.Path(tomofield.__file__).parents[1])})
    assert ended.returncode == 0 and "set it before or after" in ended.stdout, ended
