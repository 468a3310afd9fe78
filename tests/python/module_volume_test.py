"""Tomograms in memory: numpy, sections, pictures for notebooks, files, and other methods."""

import base64
import io
import json
import pathlib
import re
import subprocess

import mrcfile
import numpy as np
import pytest
from PIL import Image

import tomofield


@pytest.fixture(scope="module")
def made(series):
    return tomofield.reconstruct(series.folder / "s.mrc", tlt=series.folder / "s.tlt", thickness=16,
                                 contrast="bright", with_margin=False)


@pytest.fixture
def options(series):
    return {"tlt": series.folder / "s.tlt", "thickness": 16, "contrast": "bright",
            "with_margin": False}


def picture_of(text):
    data = re.search(r"data:image/png;base64,([^\"]+)", text).group(1)
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))


def test_numpy_takes_a_tomogram_for_its_array(made):
    tomogram = made.tomogram
    assert tomogram.shape == (16, 32, 32) and tomogram.voxel_size_A == 10
    assert np.asarray(tomogram) is tomogram.values
    assert np.mean(tomogram) == tomogram.values.mean()
    np.testing.assert_array_equal(tomogram[3], tomogram.values[3])
    np.testing.assert_array_equal(tomogram.section("x"), tomogram.values[:, :, 16])
    np.testing.assert_array_equal(tomogram.section("y", 5), tomogram.values[:, 5])
    with pytest.raises(tomofield.Error, match="one of 'x', 'y', 'z', not 'w'"):
        tomogram.section("w")
    for index in (33, -34, 2**63, 10**400):
        with pytest.raises(tomofield.Error, match="there is no section"):
            tomogram.section("x", index)


def test_notebooks_show_the_middle_section(made):
    picture = picture_of(made.tomogram._repr_html_())
    section = made.tomogram.section()[::-1]
    low, high = np.percentile(section, [0.5, 99.5])
    expected = 255 * np.clip((section - low) / (high - low), 0, 1)
    np.testing.assert_allclose(picture, expected, atol=0.51)
    assert "32 × 32 × 16 voxels (x, y, z) of 10 Å" in made.tomogram._repr_html_()
    np.testing.assert_array_equal(picture_of(made.model._repr_html_()), picture)
    assert made.verdict in made._repr_html_().replace("&#x27;", "'")


def test_large_sections_become_small_pictures():
    ramp = np.broadcast_to(np.arange(2000, dtype=np.float32), (1, 1100, 2000))
    picture = picture_of(tomofield.Tomogram(ramp, 5.0)._repr_html_())
    assert picture.shape == (275, 500)
    assert (np.diff(picture.astype(int), axis=1) >= 0).all() and picture.max() == 255
    flat = tomofield.Tomogram(np.full((2, 3, 1500), np.nan, np.float32), 5.0)
    assert picture_of(flat._repr_html_()).max() == 0


def test_mrc_files_are_written_and_read(made, tmp_path):
    path = tmp_path / "t.mrc"
    made.tomogram.write(path)
    assert mrcfile.validate(path)
    with mrcfile.open(path) as file:
        np.testing.assert_array_equal(file.data, made.tomogram.values)
        assert float(file.voxel_size.x) == 10
    again = tomofield.read_mrc(path)
    np.testing.assert_array_equal(again.values, made.tomogram.values)
    assert again.voxel_size_A == 10
    with pytest.raises(tomofield.Error, match="t.mrc' exists"):
        made.tomogram.write(path)
    tomofield.write_mrc(path, np.ones((2, 3, 4)), 2.5, overwrite=True)
    assert tomofield.read_mrc(path).shape == (2, 3, 4)
    with pytest.raises(tomofield.Error, match="give voxel_size_A, in Å"):
        tomofield.write_mrc(path, np.ones((2, 3, 4)), overwrite=True)
    with pytest.raises(tomofield.Error, match="a side of 0.0 Å"):
        tomofield.write_mrc(path, np.ones((2, 3, 4)), 0, overwrite=True)
    with pytest.raises(tomofield.Error, match="float64 has numbers that are too large"):
        tomofield.write_mrc(path, np.full((2, 3, 4), 1e300), 2.5, overwrite=True)
    views = np.array([[[np.nan, np.inf, 1, 2]]])  # a tilt series may have such pixels
    tomofield.write_mrc(path, views, 2.5, overwrite=True)
    np.testing.assert_array_equal(tomofield.read_mrc(path).values, views)
    with mrcfile.open(path) as file:  # what MRC2014 says where nothing is determined
        head = file.header
        assert (head.dmin, head.dmax, head.dmean, head.rms) == (0, -1, -2, -1)
    with pytest.raises(tomofield.Error, match="absent.mrc"):
        tomofield.read_mrc("absent.mrc")


def test_a_written_stack_is_still_a_tilt_series(series, options, tmp_path):
    tomofield.write_mrc(tmp_path / "views.mrc", series.views, 10)
    copied = tomofield.baseline(tmp_path / "views.mrc", "wbp", **options).tomogram
    direct = tomofield.baseline(series.folder / "s.mrc", "wbp", **options).tomogram
    np.testing.assert_array_equal(copied.values, direct.values)


def test_export_writes_what_the_command_writes(series, made, tmp_path):
    model = series.folder / "tomogram.h5"
    for name, words, options in (
            ("all", (), {}), ("coarse", ("--voxel-size", 20, "--mode", 12),
                              {"voxel_size_A": 20, "voxel_type": "float16"}),
            ("box", ("--center", "12,13,8", "--size", "9,8,7", "--rotate", "10,20,30", "--invert"),
             {"box": tomofield.Box((12, 13, 8), (9, 8, 7), euler_deg=(10, 20, 30)),
              "invert": True})):
        series.run("export", model, "-o", tmp_path / f"{name}_cli.mrc", *words)
        tomofield.export(model, tmp_path / f"{name}.mrc", **options)
        assert ((tmp_path / f"{name}.mrc").read_bytes()
                == (tmp_path / f"{name}_cli.mrc").read_bytes()), name
    tomofield.export(made.model, tmp_path / "all.mrc", overwrite=True)
    np.testing.assert_array_equal(mrcfile.read(tmp_path / "all.mrc"), made.tomogram.values)
    with pytest.raises(tomofield.Error, match="all.mrc' exists"):
        tomofield.export(model, tmp_path / "all.mrc")
    with pytest.raises(tomofield.Error, match="outside of the model"):
        tomofield.export(model, tmp_path / "far.mrc", box=tomofield.Box((900, 0, 0), (2, 2, 2)))
    tomofield.export(model, tmp_path / "store.mrc", zarr=True, zarr_version="0.5")
    assert (tmp_path / "store.zarr" / "zarr.json").is_file()  # of Zarr v3 alone
    with pytest.raises(tomofield.Error, match="leave voxel_size_A out"):
        tomofield.export(model, tmp_path / "x.mrc", box=tomofield.Box((9, 9, 9), (2, 2, 2)),
                         voxel_size_A=5)


def test_a_part_keeps_its_place(series, options, tmp_path, caplog):
    def origin(tomogram):
        tomogram.write(tmp_path / "part.mrc", overwrite=True)
        with mrcfile.open(tmp_path / "part.mrc", header_only=True) as file:
            return tuple(file.header.origin.tolist())

    part = {**options, "roi": (6, 4, 30, 28)}
    made = tomofield.reconstruct(series.folder / "s.mrc", **part)
    linear = tomofield.baseline(series.folder / "s.mrc", "wbp", **part)
    for tomogram in (made.tomogram, linear.tomogram, made.model.tomogram(), made.model.tomogram(20)):
        assert tomogram.origin_A == origin(tomogram) == (60, 40, 0), tomogram
    assert tomofield.read_mrc(tmp_path / "part.mrc").origin_A == (60, 40, 0)
    tomofield.export(made.model, tmp_path / "all.mrc")
    assert tomofield.read_mrc(tmp_path / "all.mrc").origin_A == (60, 40, 0)
    values = made.tomogram.values
    elsewhere = tomofield.Tomogram(values, 10, (80, 40, 0))
    for score in (tomofield.score_volume, tomofield.correlate_shells):
        caplog.clear()
        score(elsewhere, values)  # an array states no place
        assert "voxels after" not in caplog.text
        score(made.tomogram, elsewhere)
        assert "begins 2, 0, 0 voxels after" in caplog.text
    assert origin(tomofield.Tomogram(values, 10)) == (0, 0, 0)
    with pytest.raises(tomofield.Error, match="three finite numbers"):
        tomofield.Tomogram(values, 10, (0, np.nan, 0)).write(tmp_path / "nan.mrc")
    with pytest.raises(TypeError, match="origin_A"):
        tomofield.Tomogram(values, 10, (0, 0))


def same_files(folder, *names):
    for name in names:
        assert (folder / name).read_bytes() == (folder / f"cli_{name}").read_bytes(), name


def test_export_levels_as_the_command_does(series, made, tmp_path):
    model = series.folder / "tomogram.h5"
    for name, words, options in (
            ("all.mrc", ("--level", "3,-2"), {"level": (3, -2)}),
            ("box.mrc", ("--level", "3,-2", "--center", "12,13,8", "--size", "9,8,7"),
             {"level": (3, -2), "box": tomofield.Box((12, 13, 8), (9, 8, 7))})):
        series.run("export", model, "-o", tmp_path / f"cli_{name}", *words)
        tomofield.export(model, tmp_path / name, **options)
        same_files(tmp_path, name)
    for wrong, said in (((3, 95), "not below 90°"), ((3, np.nan), "not below 90°")):
        with pytest.raises(tomofield.Error, match=said):
            tomofield.export(model, tmp_path / "x.mrc", level=wrong)
    for wrong in (3, (1, 2, 3), "lost", ("a", "b")):
        with pytest.raises(TypeError, match="level is 'found' or two angles in degrees"):
            tomofield.export(model, tmp_path / "x.mrc", level=wrong)
    with pytest.raises(tomofield.Error, match="angles of its own cannot be levelled"):
        tomofield.export(model, tmp_path / "x.mrc", level=(3, 2),
                         box=tomofield.Box((12, 13, 8), (9, 8, 7), euler_deg=(1, 0, 0)))
    with pytest.raises(tomofield.Error, match="tomogram_align.json' beside"):
        tomofield.export(model, tmp_path / "x.mrc", level="found")
    with pytest.raises(tomofield.Error, match="model in memory has no alignment"):
        tomofield.export(made.model, tmp_path / "x.mrc", level="found")
    assert not (tmp_path / "x.mrc").exists()


def test_export_takes_the_level_that_was_found(series, tmp_path):
    model = tmp_path / "tomogram.h5"
    model.write_bytes((series.folder / "tomogram.h5").read_bytes())
    views = [{"section": i + 1, "tilt_deg": tilt, "shift_px": [0, 0], "rotation_deg": 0,
              "log_magnification": 0, "tilt_change_deg": 0, "correlation": 0.9,
              "shift_error_px": [0.1, 0.1], "left_out": False}
             for i, tilt in enumerate(series.tilt_deg)]
    pose = {"pitch_deg": 5, "pitch_error_deg": 1, "x_tilt_deg": -4, "x_tilt_error_deg": 0.5,
            "thickness_px": 16, "thickness_error_px": 2}
    (tmp_path / "tomogram_align.json").write_text(json.dumps(
        {"made_with": {}, "accepted": True, "rotation": True, "magnification": True, "tilt": True,
         "steps_px": [0.1], "seconds": 1, "views": views, "pose": pose,
         "series": {"sections": len(views), "size_px": [32, 32], "files": {}, "header_tilts": "0",
                    "pixels": "0"},
         "held_out_error": {"before": 0.5, "after": 0.4},
         "gain": {"mean": 0.1, "standard_error": 0.01}}))
    tomofield.export(tomofield.Model(model), tmp_path / "found.mrc", level="found")
    tomofield.export(model, tmp_path / "given.mrc", level=(5, -4))
    assert (tmp_path / "found.mrc").read_bytes() == (tmp_path / "given.mrc").read_bytes()


def test_export_cuts_particles_as_the_command_does(series, made, tmp_path):
    model, points = series.folder / "tomogram.h5", tmp_path / "points.txt"
    points.write_text("12 13 8\n20 14 7\n")
    series.run("export", model, "-o", tmp_path / "cli_cut.mrc", "--particles", points, "--box", 6,
               "--voxel-size", 12, "--level", "3,-2", "--mode", 12)
    tomofield.export(model, tmp_path / "cut.mrc", particles=points, box=6, voxel_size_A=12,
                     level=(3, -2), voxel_type="float16")
    same_files(tmp_path, "cut.mrc")
    written = (tmp_path / "cli_cut.star").read_text()
    assert (tmp_path / "cut.star").read_text() == written.replace("cli_cut.mrc", "cut.mrc")
    tomofield.export(made.model, tmp_path / "memory.mrc", particles=points, box=6, tomogram="TS_01")
    assert "TS_01" in (tmp_path / "memory.star").read_text()
    with pytest.raises(tomofield.Error, match="name: give that of its tomogram"):
        tomofield.export(made.model, tmp_path / "x.mrc", particles=points, box=6)
    with pytest.raises(tomofield.Error, match="from 1 to 4096"):
        tomofield.export(model, tmp_path / "x.mrc", particles=points, box=0)
    with pytest.raises(tomofield.Error, match="leave --zarr and --axes out"):
        tomofield.export(model, tmp_path / "x.mrc", particles=points, box=6, zarr=True)
    with pytest.raises(tomofield.Error, match="cut.mrc' exists"):
        tomofield.export(model, tmp_path / "cut.mrc", particles=points, box=6)
    with pytest.raises(TypeError, match="cubes of particles in voxels, is a whole number"):
        tomofield.export(model, tmp_path / "x.mrc", particles=points)
    with pytest.raises(TypeError, match="a side alone is for particles"):
        tomofield.export(model, tmp_path / "x.mrc", box=6)
    with pytest.raises(tomofield.Error, match="give their list with particles"):
        tomofield.export(model, tmp_path / "x.mrc", tomogram="TS_01")
    assert not (tmp_path / "x.mrc").exists()


@pytest.mark.parametrize("method", ("wbp", "sirt", "sart-tv", "tv"))
def test_baselines_are_those_of_the_command(series, options, method, tmp_path):
    series.run("baseline", method, "s.mrc", "--tlt", "s.tlt", "--thickness", 16, "--contrast",
               "bright", "--no-margin", "-o", tmp_path / "b.mrc")
    steps = []
    made = tomofield.baseline(series.folder / "s.mrc", method, progress=steps.append, **options)
    np.testing.assert_array_equal(made.tomogram.values, mrcfile.read(tmp_path / "b.mrc"))
    written = tomofield.read_record(tmp_path / "b.mrc")
    assert made.options["method"] == written.options["method"]
    assert repr(made) == f"<Reconstruction: {made.tomogram}>"
    assert made.model is None and made.verdict == "" and made.metrics["size_px"] == [32, 32, 16]
    assert steps[-1].fraction_done == 1
    in_memory = {key: value for key, value in options.items() if key != "tlt"}
    again = tomofield.baseline(series.views, method, series.tilt_deg, pixel_size_A=10, **in_memory)
    np.testing.assert_array_equal(again.tomogram.values, made.tomogram.values)


@pytest.mark.parametrize("method, words, own", (
    ("wbp", ("--window", "cosine", "--cutoff", 0.3), {"window": "cosine", "cutoff": 0.3}),
    ("tv", ("--iterations", 7, "--penalty", "concave", "--weight", 5, "--non-negative", "off"),
     {"iterations": 7, "penalty": "concave", "weight": 5, "non_negative": False}),
    ("sart-tv", ("--iterations", 2, "--tv-steps", 3), {"iterations": 2, "tv_steps": 3}),
    ("ingp", ("--iterations", 2, "--levels", 2, "--width", 8),
     {"iterations": 2, "levels": 2, "width": 8}),
    ("fourier-net", ("--iterations", 2, "--features", 8, "--seed", 5),
     {"iterations": 2, "features": 8, "seed": 5})))
def test_baselines_take_their_options_and_write_files(series, options, method, words, own, tmp_path):
    (tmp_path / "cli").mkdir()
    series.run("baseline", method, "s.mrc", "--tlt", "s.tlt", "--thickness", 16, "--contrast",
               "bright", "--no-margin", *words, "-o", tmp_path / "cli" / "b.mrc")
    made = tomofield.baseline(series.folder / "s.mrc", method, method_options=own,
                              output=tmp_path / "b.mrc", **options)
    assert made.tomogram is None and made.is_finished
    by_command = {file.name for file in (tmp_path / "cli").iterdir()}
    assert by_command == {file.name for file in tmp_path.iterdir()} - {"cli"}
    assert "b.json" in by_command and "b_xy.png" in by_command
    for file in by_command - {"b.json"}:
        assert (tmp_path / file).read_bytes() == (tmp_path / "cli" / file).read_bytes(), file
    written = tomofield.read_record(tmp_path / "cli" / "b.mrc")
    assert made.options["method"] == written.options["method"]
    assert tomofield.read_record(tmp_path / "b.mrc").options["method"] == made.options["method"]
    with pytest.raises(tomofield.Error, match="b.mrc' exists"):
        tomofield.baseline(series.folder / "s.mrc", method, method_options=own,
                           output=tmp_path / "b.mrc", **options)


@pytest.mark.parametrize("own, said", (
    ({"iterations": 0}, "--iterations must be a whole number above 0, not '0'"),
    ({"relaxation": 3}, "--relaxation must be a number from 0.01 to 1.99, not '3.0'"),
    ({"ctf_correction": "none"}, "--ctf-correction must be flip or")))
def test_values_that_a_method_cannot_take_are_named(series, options, own, said):
    with pytest.raises(tomofield.Error, match=said):
        tomofield.baseline(series.folder / "s.mrc", "sirt", method_options=own, **options)


@pytest.mark.parametrize("own, said", (
    ({"iteration": 3}, r"'sirt' has no option 'iteration' \(did you mean iterations\?\)"),
    ({"window": "hann"}, "'sirt' has no option 'window'.*relaxation"),
    ({3: 3}, "the name of a method's option is a text, not 3"),
    ({"ctf_correction": "flip", "ctf-correction": "flip"}, "have 'ctf-correction' twice"),
    ({"iterations": 2.5}, "the option iterations is a whole number, not 2.5"),
    ({"iterations": True}, "the option iterations is a whole number, not True"),
    ({"iterations": "auto"}, "the option iterations is a whole number, not 'auto'"),
    ({"relaxation": "much"}, "the option relaxation is a number, not 'much'"),
    ({"relaxation": None}, "the option relaxation is a number, not None"),
    ({"ctf_correction": True}, "the option ctf_correction is a text, not True"),
    ({"non_negative": 3}, "the option non_negative is True or False, not 3"),
    ({"non_negative": None}, "the option non_negative is True or False, not None")))
def test_options_of_methods_have_their_types(series, options, own, said):
    with pytest.raises(TypeError, match=said):
        tomofield.baseline(series.folder / "s.mrc", "sirt", method_options=own, **options)


def test_options_of_methods_may_be_automatic(series, options):
    def record(own):
        made = tomofield.baseline(series.folder / "s.mrc", "tv", **options,
                                  method_options={"iterations": np.int32(2), **own})
        return made.options["method"]
    automatic = {"weight": "auto", "penalty": "auto", "non_negative": "auto"}
    assert record(automatic) == record({}) == record({"non_negative": np.bool_(True)})
    assert record({"weight": np.float32(2)})["weight"] == 2


def test_a_method_takes_the_options_of_its_command(series):
    """What the command refuses, baseline() refuses, and the other way round."""
    page = pathlib.Path(__file__).parents[2] / "docs" / "options.md"
    rows = re.findall(r"^\| `([^`]+)` \|.*\| `(\w+)` \| `[\w.]+` \|$", page.read_text(), re.MULTILINE)
    assert len(rows) > 80
    for method in ("wbp", "ingp"):
        text = subprocess.run([series.program, "baseline", method, "--help-all"], check=True,
                              capture_output=True, text=True).stdout
        groups = text.split("\nMethod:")  # a method may have an option of the same name
        shared = groups[0] + groups[1].split("\n\n", 1)[1]
        taken = set(tomofield._core.shared_options(method))
        for flags, name in rows:
            flag = flags.split(",")[-1]
            if flag == "stack":
                continue
            has = re.search(rf"^  (-\w,)?{flag}[ \n]", shared, re.MULTILINE) is not None
            assert (name in taken) == has, (method, flag)


def test_baselines_can_be_stopped_and_refuse_what_they_cannot_do(series, options, tmp_path):
    stack = series.folder / "s.mrc"
    stopped = tomofield.baseline(stack, "sirt", progress=lambda p: p.fraction_done < 0.2, **options)
    assert not stopped.is_finished and stopped.tomogram is None
    stopped = tomofield.baseline(stack, "sirt", progress=lambda p: p.fraction_done < 0.2,
                                 output=tmp_path / "b.mrc", **options)
    assert not stopped.is_finished and list(tmp_path.glob("b*")) == []

    def fail(progress):
        raise ZeroDivisionError("of the callback")
    with pytest.raises(ZeroDivisionError, match="of the callback"):
        tomofield.baseline(stack, "sirt", progress=fail, **options)
    with pytest.raises(tomofield.Error, match="'wbp', 'sirt', 'sart-tv', 'tv', .*, not 'fbp'"):
        tomofield.baseline(stack, "fbp", **options)


def test_denoise_fits_again_without_trials(series, made):
    reports = []
    strong = tomofield.denoise(made, "strong", progress=reports.append)
    assert {report.is_trial for report in reports} == {False}
    fit, again = made.options["fit"], strong.options["fit"]
    for name in ("penalty", "density_variation", "spike_rank", "prior", "fit_view_scale", "epochs"):
        assert again[name] == fit[name], name
    assert again["denoise"] == "strong"

    def roughness(volume):
        return np.abs(np.diff(volume.values, axis=2)).mean()
    light = tomofield.denoise(made, "light")
    assert roughness(strong.tomogram) < roughness(made.tomogram) < roughness(light.tomogram)
    same = tomofield.denoise(made, "medium")
    np.testing.assert_array_equal(same.tomogram.values, made.tomogram.values)
    with pytest.raises(tomofield.Error, match="only a finished result"):
        tomofield.denoise(tomofield.baseline(series.views, "wbp", series.tilt_deg, thickness=16,
                                             pixel_size_A=10), "light")
    for wrong in (made.tomogram, "tomogram.mrc", None):
        with pytest.raises(tomofield.Error, match="only a finished result"):
            tomofield.denoise(wrong, "light")


def test_voxel_sizes_come_from_tomograms_or_are_asked_for(made, series):
    truth = tomofield.Tomogram(series.truth, 10.0)
    assert (tomofield.correlate_shells(made.tomogram, truth).frequency_per_A[-1]
            == pytest.approx(1 / 20))
    with pytest.raises(tomofield.Error, match="give voxel_size_A"):
        tomofield.correlate_shells(series.truth, series.truth)


@pytest.mark.parametrize("values, size, said", (
    (np.ones((3, 4)), 10.0, "and these have 2 dimensions"), (None, 10.0, "have 0 dimensions"),
    (np.ones((2, 3, 4)), -1.0, "a side of -1.0 Å"), (np.ones((2, 3, 4)), np.nan, "a side of nan Å")))
def test_a_tomogram_is_a_volume_with_a_size(values, size, said):
    with pytest.raises(tomofield.Error, match=said):
        tomofield.Tomogram(values, size)


def test_a_mask_that_is_set_later_is_seen():
    tomogram = tomofield.Tomogram(np.ma.array(np.ones((4, 8, 8), np.float32)), 10)
    tomogram.values[2] = np.ma.masked
    with pytest.raises(tomofield.Error, match="no masked voxels"):
        tomogram.section("z", 2)
    assert tomogram.section("z", 1).dtype == np.float32


def test_numbers_that_floats_lose_are_refused_beside_nan(tmp_path):
    large = np.random.default_rng(0).normal(3e7, 1, (8, 16, 16))
    small = np.random.default_rng(0).normal(0, 1e-50, (8, 16, 16))
    for values, reason in ((large, "lost in the 32-bit floats"), (small, "do not hold")):
        values[:, 0, 0] = np.nan
        with np.errstate(all="raise"):
            with pytest.raises(tomofield.Error, match=reason):
                tomofield.write_mrc(tmp_path / "a.mrc", values, 10)
    small[3] = np.random.default_rng(1).normal(0, 1, (16, 16))  # the others are zeros beside it
    tomofield.write_mrc(tmp_path / "a.mrc", small, 10)


def test_an_array_that_cannot_be_read_has_its_reason():
    class Damaged:
        def __array__(self, dtype=None):
            raise OSError("filter returned failure")

    damaged = Damaged()
    for call in (lambda: tomofield.Tomogram(damaged, 10),
                 lambda: tomofield.score_volume(damaged, np.ones((8, 16, 16)))):
        with pytest.raises(tomofield.Error, match="type Damaged cannot be read.*filter returned"):
            call()
