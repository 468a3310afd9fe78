"""What functions say of arguments of a wrong type: a sentence with what to give, and none of
pybind11's or numpy's own."""

import pathlib

import numpy as np
import pytest

import tomofield

VIEWS, TILTS = np.ones((3, 8, 8), np.float32), [-10, 0, 10]


@pytest.fixture(name="model", scope="module")
def read_model(series):
    return tomofield.Model(series.folder / "tomogram.h5")


CALLS = {
    "a series is the path of a stack": lambda m, s: tomofield.reconstruct(3),
    "a series is the path": lambda m, s: tomofield.baseline(None, "wbp"),
    "a series is": lambda m, s: tomofield.align({}),
    "progress is a function": lambda m, s: tomofield.reconstruct(VIEWS, TILTS, pixel_size_A=1,
                                                              progress=3),
    "thickness cannot be 'much': give a number": lambda m, s: tomofield.reconstruct(s,
                                                                                thickness="much"),
    "rank cannot be 2.5: give a whole number or None": lambda m, s: tomofield.reconstruct(
        s, rank=2.5),
    "tlt cannot be 3: give a path or None": lambda m, s: tomofield.reconstruct(s, tlt=3),
    "contrast cannot be 3: give 'dark' or 'bright'": lambda m, s: tomofield.reconstruct(
        s, contrast=3),
    "roi cannot be 3: give 4 whole numbers or None": lambda m, s: tomofield.reconstruct(s, roi=3),
    "tune cannot be 'yes': give True or False": lambda m, s: tomofield.reconstruct(s, tune="yes"),
    "method_options are names with values": lambda m, s: tomofield.baseline(s, "wbp",
                                                                         method_options=3),
    "the project is a path, a str or a pathlib.Path, not 3": lambda m, s: tomofield.open_project(3),
    "series is a text, not 3": lambda m, s: tomofield.open_project(s, series=3),
    "a model's file is a path": lambda m, s: tomofield.Model(3),
    "voxel_px is a number, not 'x'": lambda m, s: m.region("x"),
    "voxel_size_A is a number, not 'x'": lambda m, s: m.tomogram("x"),
    "voxel_size_A is a number, not True": lambda m, s: m.tomogram(True),
    "a box is a tomofield.Box, not 3": lambda m, s: m.sample(3),
    "three whole numbers in size": lambda m, s: m.sample(tomofield.Box((9, 9, 9), (2, 2, 2.5))),
    "three numbers in centre_px": lambda m, s: m.sample(tomofield.Box((9, 9), (2, 2, 2))),
    "the output is a path": lambda m, s: tomofield.export(m, 3),
    "a model's file is a path, a str": lambda m, s: tomofield.export(3, "x.mrc"),
    "axes cannot be 3: give 'xyz' or 'xzy'": lambda m, s: tomofield.export(m, "x.mrc", axes=3),
    "the list of particles is a path": lambda m, s: tomofield.export(m, "x.mrc", particles=3, box=4),
    "a volume's file is a path": lambda m, s: tomofield.read_mrc(3),
    "voxel_size_A is a number": lambda m, s: tomofield.write_mrc("x.mrc", VIEWS, "x"),
    "the output is a path, a str": lambda m, s: tomofield.write_mrc(3, VIEWS, 2.0),
    "the record is a path": lambda m, s: tomofield.read_record(3),
    "the number of threads is a whole number": lambda m, s: tomofield.set_thread_count("two"),
    "method is a text, not ['wbp']": lambda m, s: tomofield.baseline(s, ["wbp"]),
    "the method 'ingp' does not take resume, epochs, denoise, tune: leave them out":
        lambda m, s: tomofield.baseline(s, "ingp", resume=True, epochs=3, denoise="strong",
                                        tune=True),
    "the method 'wbp' does not take even: leave it out": lambda m, s: tomofield.baseline(
        s, "wbp", even="x.mrc"),
    "level is 'found' or two angles in degrees, (pitch, x_tilt), not '12'":
        lambda m, s: tomofield.export(m, "x.mrc", level="12"),
    "not ('3', '2')": lambda m, s: tomofield.export(m, "x.mrc", level=("3", "2")),
    "not (True, False)": lambda m, s: tomofield.export(m, "x.mrc", level=(True, False)),
    "not {1: 1, 2: 2}": lambda m, s: tomofield.export(m, "x.mrc", level={1: 1, 2: 2}),
    "voxel_px is a number, not (1+2j)": lambda m, s: m.region(np.complex64(1 + 2j)),
    "the threshold is a number, not 'x'": lambda m, s: tomofield.correlate_shells(
        np.random.default_rng(1).random((8, 8, 8)), np.random.default_rng(2).random((8, 8, 8)),
        1.0).resolution_A("x"),
}


@pytest.mark.parametrize("said", CALLS)
def test_a_wrong_type_is_answered_with_what_to_give(series, model, said):
    with pytest.raises(TypeError) as refused:
        CALLS[said](model, series.folder / "s.mrc")
    text = str(refused.value)
    assert said in text and "incompatible" not in text and "\n" not in text, text


MASKED = np.ma.masked_array(np.ones((3, 8, 8)), mask=np.arange(192).reshape(3, 8, 8) == 5)
MASKED_ELEMENTS = "an array with masked elements"
SENTENCES = (
    ("the number of threads must be from 1 to 1024", lambda m: tomofield.set_thread_count(-1)),
    ("or 0 for the default, not 1000000", lambda m: tomofield.set_thread_count(10**6)),
    ("too little memory", lambda m: tomofield.score_volume(  # of 2 EiB, which no machine has
        *2 * [np.broadcast_to(np.float64(1), (1 << 20, 1 << 20, 1 << 19))])),
    (MASKED_ELEMENTS, lambda m: tomofield.reconstruct(MASKED, TILTS, pixel_size_A=1, thickness=4)),
    (MASKED_ELEMENTS, lambda m: tomofield.reconstruct(
        VIEWS, np.ma.masked_array(TILTS, mask=[0, 0, 1]), pixel_size_A=1, thickness=4)),
    (MASKED_ELEMENTS, lambda m: m.sample_points(np.ma.masked_array([[1, 2, 3]], mask=True))),
    (MASKED_ELEMENTS, lambda m: tomofield.score_volume(VIEWS, MASKED)),
    (MASKED_ELEMENTS, lambda m: tomofield.write_mrc("x.mrc", MASKED, 1.0)),
    ("no masked voxels", lambda m: tomofield.Tomogram(MASKED, 1.0)),
)


@pytest.mark.parametrize("said, call", SENTENCES)
def test_what_cannot_be_used_is_refused_in_a_sentence(model, said, call):
    with pytest.raises(tomofield.Error, match=said):
        call(model)


def test_errors_say_what_they_are():
    assert "what to do" in tomofield.Error.__doc__


def test_numbers_and_paths_of_every_kind_are_taken(series, model):
    assert model.region(np.float32(2)).size == model.region(2).size == (16, 16, 8)
    for path in (str(series.folder / "truth.mrc"), bytes(series.folder / "truth.mrc"),
                 pathlib.Path(series.folder / "truth.mrc")):
        assert tomofield.read_mrc(path).shape == (16, 32, 32)
    tomofield.set_thread_count(np.int64(0))
    whole = np.ma.masked_array(np.random.default_rng(1).random((8, 9, 10)), mask=False)
    assert tomofield.score_volume(whole, whole).correlation == pytest.approx(1)
    assert len(tomofield.Tomogram(whole, 1.0)) == 8


@pytest.mark.parametrize("name, like", (
    ("tv", "density_variation"), ("variation", "factor_variation or density_variation"),
    ("margin", "with_margin or margin_spacing"), ("thick", "thickness"),
    ("view_scale", "fit_view_scale"), ("zzz", None)))
def test_names_that_share_words_with_an_option_are_alike(name, like):
    with pytest.raises(TypeError) as refused:
        tomofield.reconstruct(VIEWS, TILTS, pixel_size_A=1, **{name: 3})
    suggested = "" if like is None else f" (did you mean {like}?)"
    assert str(refused.value) == f"there is no option '{name}'{suggested}"
