"""Tests what bench/gate compares, on made-up results: each kind of change makes it fail, and the
fault names the case, the value, what was expected and what came."""

import os
import subprocess
import sys

import numpy as np
import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

# pylint: disable=wrong-import-position
import exosome_page
import gate_cases
import gate_checks
import readme_page

SETTINGS = {"chosen.tv": 9.0, "chosen.tv_penalty": "smooth", "chosen.view_scale": True}
VALUES = {"residual": 1.5, "held_out_error": 2.0, "speckle_percent": 0.05, "face_jump": 1.0,
          "psnr_dB": 24.0, "beads": 81}
SLICE = np.random.default_rng(5).integers(0, 256, size=(30, 40)).astype(np.uint8)
EXPECTED = gate_cases.Result(SETTINGS, VALUES, SLICE)


def faults(**changed):
    """Returns the faults of a result that differs from the expected one in some parts."""
    return gate_checks.differences("exosomes", EXPECTED, EXPECTED._replace(**changed),
                                   "exosomes.png")


def test_the_expected_result_passes():
    assert faults() == []


@pytest.mark.parametrize("name, found, words", (
    ("chosen.tv_penalty", "concave",
     "the setting chosen.tv_penalty is 'concave'; expected 'smooth'"),
    ("chosen.tv", 7.8, "the setting chosen.tv is 7.8; expected 9.0"),
    ("chosen.view_scale", False, "the setting chosen.view_scale is False; expected True"),
))
def test_a_changed_setting_is_named(name, found, words):
    assert faults(settings={**SETTINGS, name: found}) == [f"exosomes: {words}"]


def test_a_lost_setting_is_named():
    rest = {key: value for key, value in SETTINGS.items() if key != "chosen.tv"}
    assert faults(settings=rest) == ["exosomes: the setting chosen.tv is None; expected 9.0"]


def test_rounding_of_a_setting_and_new_options_are_no_faults():
    assert faults(settings={**SETTINGS, "chosen.tv": 9.0 * (1 + 1e-9), "fit.new_option": 1}) == []


@pytest.mark.parametrize("name", sorted(VALUES))
@pytest.mark.parametrize("side", (-1, 1))
def test_a_value_outside_its_band_is_named(name, side):
    step = max(gate_checks.half_width(name, VALUES[name]), 0.5)
    found = VALUES[name] + side * 1.01 * step
    one, = faults(values={**VALUES, name: found})
    assert one.startswith(f"exosomes: {name} is {found:.4g}; expected {VALUES[name]:.4g} ± ")


@pytest.mark.parametrize("name", sorted(VALUES))
@pytest.mark.parametrize("side", (-1, 1))
def test_a_value_inside_its_band_passes(name, side):
    found = VALUES[name] + side * 0.99 * gate_checks.half_width(name, VALUES[name])
    assert faults(values={**VALUES, name: found}) == []


def test_values_that_are_no_numbers_or_absent_or_unexpected_are_named():
    assert "residual is nan" in faults(values={**VALUES, "residual": float("nan")})[0]
    assert "beads is missing" in faults(
        values={key: value for key, value in VALUES.items() if key != "beads"})[0]
    expected = EXPECTED._replace(values={})
    assert "residual was not expected" in gate_checks.differences(
        "exosomes", expected, EXPECTED._replace(values={"residual": 1.5}), "exosomes.png")[0]


def test_an_altered_slice_is_named():
    altered = SLICE.copy()
    altered[:, :10] = altered[::-1, :10]
    one, = faults(picture=altered)
    assert one.startswith("exosomes: the central slice correlates by 0.")
    assert one.endswith("with exosomes.png; expected at least 0.98")
    assert "has 40 x 29 pixels; expected 40 x 30" in faults(picture=SLICE[:-1])[0]
    assert len(faults(picture=np.zeros_like(SLICE))) == 1  # it has no correlation


def test_a_slice_with_other_bits_passes():
    noise = np.random.default_rng(6).integers(-3, 4, size=SLICE.shape)
    assert faults(picture=np.clip(SLICE + noise, 0, 255).astype(np.uint8)) == []


def run_gate(scratch, *arguments):
    command = ["/usr/bin/python3", os.path.join(BENCH, "gate"), scratch / "out", "--program",
               harness.PROGRAM, *arguments]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.parametrize("case", ("exosomes", "idp_haadf", "ta_film"))
def test_absent_data_are_said_to_be_skipped(case, scratch):
    done = run_gate(scratch, "--only", f"^{case}$", "--data", scratch / "nothing")
    assert done.returncode == 77, done.stderr
    assert done.stdout.startswith(f"skipped {case}: there is no folder ")


def test_a_name_of_no_case_is_refused(scratch):
    done = run_gate(scratch, "--only", "exosmoe")
    assert done.returncode == 2
    assert "no case matches 'exosmoe'; there are exosomes, " in done.stderr


STATED = {"views": "31", "width": "341", "height": "480", "pixel_size_A": "16.56",
          "core_seconds": "90", "beads": "81", "compact_MB": "2.2", "half_float_MB": "52"}
README = """
![both](docs/results/exosome_pair.png)
Frozen exosomes: 31 views of 341 × 480 pixels, 16.56 Å a pixel, on Debian 12. It took about 90
core-seconds. (81 gold beads were found in it.) `--bin 2` makes a
small file: 2.2 MB, where the tomogram of half floats has 52 MB.
A series of 61 views of 4096 × 4096 pixels, 1024 thick, took 3.8 core-hours and 14 GiB with a vertex
each 3 pixels. Its compact model has 16 MB, where the tomogram has 34 GB.
"""
PAGE = """
## 4096² × 61 views, 1024 thick
was fitted with a vertex each **3 pixels**
| time | 13 530 core-seconds, 3.8 core-hours |
| memory | 14.0 GiB |
| model, checkpoint, tomogram | 2.96 GB, 8.9 GB, 34.4 GB; a compact model has 16 MB |
"""


def readme_faults(text=README, page=PAGE, pictures=(readme_page.PICTURE,)):
    return readme_page.faults(text, STATED, pictures, lambda _: page)


def test_a_readme_of_recorded_numbers_passes():
    assert readme_faults() == []


@pytest.mark.parametrize("old, new, fault", (
    ("(81 gold", "(79 gold", "beads is 79; bench/readme made 81"),
    ("about 90", "about 46", "core_seconds is 46; bench/readme made 90"),
    ("gold beads", "golden beads", "no sentence is like"),
    ("34 GB", "35 GB", "volume is 35; docs/results/speed.md has 34.4"),
    ("It took", "It took 5 days, or", "nobody makes the number 5"),
    ("It took", "![new](other.png) It took", "bench/readme does not make the picture other.png"),
))
def test_a_readme_that_says_something_else_is_named(old, new, fault):
    found = readme_faults(README.replace(old, new))
    assert any(fault in one for one in found), found


def test_a_page_that_was_measured_again_is_named():
    assert readme_faults(page=PAGE.replace("3.8 core-hours", "2.9 core-hours")) == [
        "hours is 3.8; docs/results/speed.md has 2.9"]


def test_numbers_are_written_into_their_sentences():
    stated = {**STATED, "core_seconds": "117", "beads": "9", "compact_MB": "1.15"}
    text = readme_page.with_numbers(README, stated)
    assert "took about 117\ncore-seconds. (9 gold beads" in text and "small file: 1.15 MB" in text
    assert readme_page.with_numbers(text, STATED) == README


def test_the_page_of_the_exosomes_keeps_what_is_around_its_lines():
    page = f"before\n{exosome_page.BEGIN}old\n{exosome_page.END}\nafter\n"
    assert exosome_page.parts(page) == (f"before\n{exosome_page.BEGIN}", "old\n",
                                        f"{exosome_page.END}\nafter\n")
    with pytest.raises(ValueError, match="lacks the marks"):
        exosome_page.parts("before\nafter\n")
