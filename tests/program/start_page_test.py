"""Tests docs/start.md and docs/data.md: their commands run on the folders that bench/start_folders.py
makes, write the files that the page names, and the folders of other programs give one tomogram."""

import json
import os
import re
import sys

import numpy as np
import pytest

import harness

PROJECT = os.path.abspath(os.path.join(os.path.dirname(__file__), "../.."))
sys.path.insert(0, os.path.join(PROJECT, "bench"))

# pylint: disable=wrong-import-position
import readme_page
import start_folders
import start_page

QUICK = ["--epochs", 2, "--coarse-epochs", 4, "--tv", 5, "--prior", "tv", "--overwrite"]
DATA_PAGE = os.path.join(PROJECT, "docs", "data.md")


@pytest.fixture(name="folder", scope="module")
def make_folder():
    """Returns a folder with what the pages name, and the results of the commands of docs/start.md."""
    folder = harness.fresh_directory("start")
    start_folders.make_folders(harness.PROGRAM, folder, 64)
    for words in start_page.commands():
        quick = {"reconstruct": QUICK, "export": ["--overwrite"]}.get(words[0], [])
        harness.succeed(*words, *quick, cwd=folder)
    return folder


def test_the_page_has_its_commands_and_a_picture_of_each():
    made = [words[words.index("-o") + 1] for words in start_page.commands() if "-o" in words]
    assert [name.removesuffix(".mrc") for name in made if "_" not in name] == [
        "etomo", "aretomo", "relion", "serialem"]
    assert list(start_page.pictures().values()) == [
        start_page.REPORT, *(f"{name}_xy.png" for name in ("etomo", "aretomo", "relion", "serialem"))]
    with open(os.path.join(PROJECT, "bench/gate_expected/readme.json"), encoding="utf-8") as file:
        assert set(start_page.pictures()) <= set(json.load(file)["pictures"])


def test_the_commands_write_the_files_that_the_page_names(folder):
    assert all(os.path.exists(os.path.join(folder, made)) for made in start_page.pictures().values())
    text = readme_page.read(start_page.PAGE)
    named = set(re.findall(r"`((?:etomo|aretomo|relion|serialem)[_.][\w.]+)`", text))
    assert {"aretomo.zarr", "relion.star", "serialem_align.xf", "serialem_align.aln"} <= named
    assert [name for name in named if not os.path.exists(os.path.join(folder, name))] == []
    for words in start_page.commands():
        if words[0] == "reconstruct":
            results = harness.Results(os.path.join(folder, words[words.index("-o") + 1]))
            assert np.isfinite(results.volume).all() and results.volume.std() > 0
            assert os.path.exists(results.volume_path.replace(".mrc", "_report.html"))


def test_all_alignments_of_one_series_give_one_tomogram(folder):
    """Linear back-projections: a shift of a pixel in one of the files would lower the correlation
    of these noisy volumes far more."""
    volumes = []
    for source in ("etomo", "aretomo/TS_01.aln", "relion/Tomograms/job009/tomograms.star"):
        output = os.path.join(folder, "wbp.mrc")
        harness.succeed("baseline", "wbp", source, "--ctf", "none", "--bead-diameter", 0, "-o", output,
                        "--overwrite", cwd=folder)
        volumes.append(harness.read_volume(output))
    for other in volumes[1:]:
        assert np.corrcoef(volumes[0].ravel(), other.ravel())[0, 1] > 0.995


def test_the_commands_of_the_page_of_data_run(folder):
    commands = start_page.commands(readme_page.read(DATA_PAGE).replace("\\\n", " "))
    assert len(commands) == 4
    for words in commands:
        harness.succeed(*words, *(QUICK if words[0] == "reconstruct" else []), cwd=folder)


def test_the_raw_series_has_the_defocus_that_its_session_aimed_at(folder):
    """Membranes that lie flat are lost without a contrast transfer."""
    with open(os.path.join(folder, "serialem.json"), encoding="utf-8") as file:
        origins = json.load(file)["origins"]
    (defocus,) = [origin for origin in origins if origin["option"] == "--defocus"]
    assert defocus["entry"] == "TargetDefocus" and defocus["value"] == f"{start_folders.TARGET_UM:g}"
