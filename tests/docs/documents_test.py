"""Checks that the documents are right: links resolve, commands parse, and named files exist."""

import pathlib

import pytest

import documents

PROJECT = pathlib.Path(__file__).resolve().parents[2]
DOCUMENTS = documents.documents(PROJECT)
CURRENT = [path for path in DOCUMENTS if not documents.is_history(PROJECT, path)]


def name_of(path):
    return path.relative_to(PROJECT).as_posix()


@pytest.fixture(name="tomofield", scope="module")
def make_tomofield(program):
    return documents.Program(program)


@pytest.fixture(name="known_options", scope="module")
def make_known_options(tomofield):
    """Returns every option of the program and of the benches."""
    benches = [path.read_text(encoding="utf-8") for path in (PROJECT / "bench").iterdir()
               if path.is_file()]
    return tomofield.all_options().union(*map(documents.OPTION.findall, benches))


def test_there_are_documents():
    assert {"README.md", "CONTRIBUTING.md", "docs/index.md"} <= set(map(name_of, CURRENT))


@pytest.mark.parametrize("path", DOCUMENTS, ids=name_of)
def test_links_resolve(path):
    assert documents.broken_links(path) == []


@pytest.mark.parametrize("path", CURRENT, ids=name_of)
def test_commands_parse(path, tomofield):
    assert documents.unknown_commands(path.read_text(encoding="utf-8"), tomofield) == []


@pytest.mark.parametrize("path", CURRENT, ids=name_of)
def test_options_exist(path, known_options):
    assert documents.unknown_options(path.read_text(encoding="utf-8"), known_options) == []


@pytest.mark.parametrize("path", CURRENT, ids=name_of)
def test_named_files_exist(path):
    assert documents.missing_paths(path.read_text(encoding="utf-8"), PROJECT) == []


def test_broken_links_are_found(tmp_path):
    (tmp_path / "other.md").write_text("# A heading: of two\n")
    page = tmp_path / "page.md"
    page.write_text("# Page\n[a](other.md) [b](other.md#a-heading-of-two) [c](#page)\n"
                    "[d](https://example.org/none) ![e](none.png) [f](other.md#none)\n"
                    "<img src=\"lost.png\">\n")
    assert documents.broken_links(page) == ["none.png", "other.md#none", "lost.png"]


@pytest.mark.parametrize("text, faults", (
    ("    tomofield simulate OUT --size 64\n", []),
    ("    tomofield simulate OUT --sise 64\n", ["--sise"]),
    ("```\ntomofield simulate \\\n  OUT --size 3 --wrong  # --not an option\n```\n", ["--wrong"]),
    ("Text with `tomofield simulat` in it.\n", ["simulat"]),
    ("    mpirun -np 4 build/release/tomofield reconstruct … --epoch 3\n", ["--epoch"]),
    ("    tomofield baseline METHOD S.mrc -o V.mrc --cutoff 0.2 --cut 3 | grep --color x\n",
     ["--cut"]),
    ("A sentence about what tomofield simulat does.\n", []),
))
def test_wrong_commands_are_found(text, faults, tomofield):
    found = documents.unknown_commands(text, tomofield)
    assert [fault for _, names in found for fault in names] == faults


def test_wrong_options_are_found(known_options):
    text = "The options `--size`, `--thickness 300`, `--seed=3` and `--sise N`.\n"
    assert documents.unknown_options(text, known_options) == ["--sise"]


def test_missing_files_are_found():
    text = ("`src/base/`, `src/base/none.h`, `base/threads/parallel.h`, `base/none.h`, `./test`, `./none`, "
            "`docs/index.md`, `none.md`, `tests/program/NAME_test.py`, `tests/program/NAME_none.py`, "
            "`build/none`, `/field/tree`, `run.json`\n")
    assert documents.missing_paths(text, PROJECT) == [
        "./none", "base/none.h", "none.md", "src/base/none.h", "tests/program/NAME_none.py"]
