"""What functions say of arguments of a wrong type: a sentence with what to give, and none of
pybind11's or numpy's own."""

import collections
import fractions
import pathlib
import re

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
    "thickness cannot be masked: give a number": lambda m, s: tomofield.reconstruct(
        s, thickness=np.ma.masked),
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
    "the threshold is a number, not 'x'": lambda m, s: curve().resolution_A("x"),
    "the threshold is a number, not True": lambda m, s: curve().resolution_A(True),
    "thickness cannot be True: give a number": lambda m, s: fit(thickness=True),
    "thickness cannot be (8+1j): give a number": lambda m, s: fit(thickness=np.complex64(8 + 1j)),
    "pixel_size_A cannot be False: give a number": lambda m, s: fit(pixel_size_A=np.bool_(False)),
    "epochs cannot be True: give a whole number": lambda m, s: fit(epochs=True),
    "epochs cannot be numpy.timedelta64(1)": lambda m, s: fit(epochs=np.timedelta64(1)),
    "seed cannot be array(True): give a whole number": lambda m, s: fit(seed=np.array(True)),
    "hand cannot be True: give 1 or -1": lambda m, s: fit(hand=True),
    "roi cannot be (True, 0, 8, 8)": lambda m, s: fit(roi=(True, 0, 8, 8)),
    "roi cannot be array([ True, True, True, True])": lambda m, s: fit(roi=np.ones(4, bool)),
    "size is a whole number, not True": lambda m, s: box(size=(True, 2, 2)),
    "centre_px is a number, not True": lambda m, s: box(centre_px=np.ones(3, bool)),
    "centre_px is a number, not (1+0j)": lambda m, s: box(centre_px=np.ones(3, complex)),
    "euler_deg is a number, not (1+0j)": lambda m, s: box(euler_deg=np.ones(3, complex)),
    "voxel_px is a number, not True": lambda m, s: box(voxel_px=True),
    "centre_px is 3 numbers, not '123'": lambda m, s: box(centre_px="123"),
    "index is a whole number, not True": lambda m, s: tomofield.Tomogram(VIEWS, 1).section("z", True),
    "voxel_size_A is a number, not '10'": lambda m, s: tomofield.Tomogram(VIEWS, "10"),
    "overwrite is True or False, not 'no'": lambda m, s: tomofield.write_mrc(
        "x.mrc", VIEWS, 1, overwrite="no"),
}


def curve():
    first, second = np.random.default_rng(1).random((2, 8, 8, 8))
    return tomofield.correlate_shells(first, second, 1.0)


def fit(views=VIEWS, tilts=TILTS, **options):
    return tomofield.reconstruct(views, tilts, **{"pixel_size_A": 1, "thickness": 4, **options})


def box(**parts):
    whole = {"centre_px": (9, 9, 9), "size": (2, 2, 2), **parts}
    tomofield._volumes._core_box(tomofield.Box(**whole))


@pytest.mark.parametrize("said", CALLS)
def test_a_wrong_type_is_answered_with_what_to_give(series, model, said):
    with pytest.raises(TypeError) as refused:
        CALLS[said](model, series.folder / "s.mrc")
    text = str(refused.value)
    assert said in text and "incompatible" not in text and "\n" not in text, text


MASKED = np.ma.masked_array(np.ones((3, 8, 8)), mask=np.arange(192).reshape(3, 8, 8) == 5)
MASKED_ELEMENTS = "an array with masked elements"


class Holder:
    """Gives numpy an array."""

    def __init__(self, array):
        self.array = array

    def __array__(self, dtype=None):
        return self.array


SENTENCES = (
    ("the number of threads must be from 1 to 1024", lambda m: tomofield.set_thread_count(-1)),
    ("or 0 for the default, not 1000000", lambda m: tomofield.set_thread_count(10**6)),
    ("or 0 for the default, not 2147483648", lambda m: tomofield.set_thread_count(2**31)),
    ("too little memory", lambda m: tomofield.score_volume(  # of 2 EiB, which no machine has
        *2 * [np.broadcast_to(np.float64(1), (1 << 20, 1 << 20, 1 << 19))])),
    ("too little memory", lambda m: tomofield.score_volume(  # of more bytes than have a number
        *2 * [np.broadcast_to(np.int8(1), (1 << 21, 1 << 21, 1 << 20))])),
    ("lost in the 32-bit floats", lambda m: fit(np.random.default_rng(1).normal(1e9, 1, VIEWS.shape))),
    ("cannot be used: File name too long", lambda m: tomofield.write_mrc("x" * 300, VIEWS, 10)),
    ("names a folder", lambda m: tomofield.read_record("")),
    (MASKED_ELEMENTS, lambda m: fit(MASKED)),
    (MASKED_ELEMENTS, lambda m: fit(list(MASKED))),
    (MASKED_ELEMENTS, lambda m: fit([VIEWS[0].tolist(), *MASKED[:2]])),
    (MASKED_ELEMENTS, lambda m: fit([[row for row in view] for view in MASKED])),
    (MASKED_ELEMENTS, lambda m: fit(tilts=np.ma.masked_array(TILTS, mask=[0, 0, 1]))),
    (MASKED_ELEMENTS, lambda m: fit(tilts=[-10, np.ma.masked, 10])),
    (MASKED_ELEMENTS, lambda m: tomofield.score_volume(VIEWS, Holder(MASKED))),
    (MASKED_ELEMENTS, lambda m: tomofield.correlate_shells([Holder(v) for v in MASKED], VIEWS, 1.0)),
    (MASKED_ELEMENTS, lambda m: tomofield.write_mrc("x.mrc", collections.deque(MASKED), 1.0)),
    (MASKED_ELEMENTS, lambda m: m.sample_points(np.ma.masked_array([[1, 2, 3]], mask=True))),
    (MASKED_ELEMENTS, lambda m: tomofield.score_volume(VIEWS, MASKED)),
    (MASKED_ELEMENTS, lambda m: tomofield.write_mrc("x.mrc", MASKED, 1.0)),
    ("float64 has numbers that are too large", lambda m: tomofield.reconstruct(
        np.full((3, 8, 8), 1e300), TILTS, pixel_size_A=1)),
    ("has real numbers, .* type complex64", lambda m: tomofield.Tomogram(VIEWS + 5j, 1.0)),
    ("has real numbers, .* type datetime64", lambda m: tomofield.Tomogram(VIEWS.astype("M8[s]"), 1)),
    ("has real numbers, .* type <U", lambda m: tomofield.Tomogram(VIEWS.astype("U"), 1)),
    ("has real numbers, .* type object", lambda m: tomofield.Tomogram(VIEWS.astype(object), 1)),
    ("no masked voxels", lambda m: tomofield.Tomogram(MASKED, 1.0)),
    ("no masked voxels", lambda m: tomofield.Tomogram(list(MASKED), 1.0)),
    ("tilt angles are numbers, not True or False", lambda m: fit(tilts=np.array(TILTS) > 0)),
    ("tilt angles are numbers", lambda m: fit(tilts=[True, *TILTS[1:]])),
    ("points are numbers", lambda m: m.sample_points([[1, 2, False]])),
    ("epochs takes numbers up to 2147483647, not 2147483648", lambda m: fit(epochs=2**31)),
    ("seed takes numbers from 0 on, not -1", lambda m: fit(seed=-1)),
    ("seed takes numbers up to 18446744073709551615", lambda m: fit(seed=2**64)),
    ("roi takes numbers up to 9223372036854775807", lambda m: fit(roi=(0, 0, 8, 2**63))),
    ("thickness takes numbers up to 1.79.*, not a number of thousands", lambda m: fit(
        thickness=10**5000)),
    ("in voxels, is a whole number up to 9223372036854775807", lambda m: tomofield.export(
        m, "x", particles="p.txt", box=2**63)),
    ("size is a whole number up to", lambda m: box(size=(1, 1, 2**63))),
    ("threads is a whole number up to", lambda m: tomofield.set_thread_count(2**70)),
    ("voxel_size_A is a number up to 1.79", lambda m: tomofield.write_mrc("x.mrc", VIEWS, 2**2000)),
    ("a side of 1e\\+300 Å: give voxel_size_A, from 0.001 to 10000000 Å",
     lambda m: tomofield.Tomogram(VIEWS, 1e300)),
    ("a side of 1e\\+300 Å", lambda m: tomofield.correlate_shells(VIEWS, VIEWS, 1e300)),
    ("the threshold is a correlation from -1 to 1, not nan", lambda m: curve().resolution_A(np.nan)),
    ("no path holds a null character", lambda m: tomofield.read_mrc("a\0b")),
    ("no path holds such a character", lambda m: tomofield.Model("\ud800")),
    ("no path holds such a character", lambda m: tomofield.read_record("a\ud800b")),
)


@pytest.mark.parametrize("said, call", SENTENCES)
def test_what_cannot_be_used_is_refused_in_a_sentence(model, said, call, recwarn):
    with pytest.raises(tomofield.Error, match=said):
        call(model)
    assert not recwarn.list  # numpy warns of what it casts


def test_errors_say_what_they_are():
    assert "what to do" in tomofield.Error.__doc__


def test_numbers_and_paths_of_every_kind_are_taken(series, model):
    assert model.region(np.float32(2)).size == model.region(2).size == (16, 16, 8)
    for path in (str(series.folder / "truth.mrc"), bytes(series.folder / "truth.mrc"),
                 pathlib.Path(series.folder / "truth.mrc")):
        assert tomofield.read_mrc(path).shape == (16, 32, 32)
    tomofield.set_thread_count(np.int64(0))
    assert set_options(take_log=np.bool_(True), thickness=np.array(8)) == (True, 8)
    assert curve().resolution_A(np.float32(0.5)) == curve().resolution_A(0.5)
    with pytest.raises(tomofield.Error, match="absent.mrc"):
        tomofield.reconstruct(b"absent.mrc", thickness=4)
    whole = np.ma.masked_array(np.random.default_rng(1).random((8, 9, 10)), mask=False)
    assert tomofield.score_volume(whole, whole).correlation == pytest.approx(1)
    assert tomofield.score_volume(list(whole), Holder(whole)).correlation == pytest.approx(1)
    assert len(tomofield.Tomogram(whole, 1.0)) == 8
    listed = tomofield.Tomogram([[[1.0, 2.0]], [[3.0, 4.0]]], 1.0)
    assert listed.shape == (2, 1, 2) and listed.section().shape == (1, 2)


def set_options(**options):
    core = tomofield._projects.chosen(tomofield._core.Choices(), options)
    return tuple(getattr(core, name) for name in options)


def test_a_value_is_shown_on_one_line():
    with pytest.raises(TypeError) as refused:
        fit(thickness=VIEWS)
    assert re.fullmatch(r"the option thickness cannot be array\(.{94}\.\.\.: give a number",
                        str(refused.value))


@pytest.mark.parametrize("name, like", (
    ("tv", "density_variation"), ("variation", "factor_variation or density_variation"),
    ("margin", "with_margin or margin_spacing"), ("thick", "thickness"),
    ("view_scale", "fit_view_scale"), ("zzz", None)))
def test_names_that_share_words_with_an_option_are_alike(name, like):
    with pytest.raises(TypeError) as refused:
        tomofield.reconstruct(VIEWS, TILTS, pixel_size_A=1, **{name: 3})
    suggested = "" if like is None else f" (did you mean {like}?)"
    assert str(refused.value) == f"there is no option '{name}'{suggested}"


@pytest.mark.parametrize("name, value", [
    ("epochs", np.float32(2.7)), ("epochs", np.array([2.7])), ("epochs", fractions.Fraction(27, 10)),
    ("roi", np.array([1.9, 0, 24.9, 24], np.float32)), ("roi", b"\0\0\x18\x18"),
    ("thickness", np.array("2")), ("defocus_hand", np.float32(1.7))])
def test_no_fraction_is_cut_off_and_no_text_is_a_number(name, value):
    with pytest.raises(TypeError, match=f"the option {name} cannot be"):
        fit(**{name: value})
