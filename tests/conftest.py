"""Options and fixtures of the tests that are written in Python.

/usr/bin/python3 -m pytest tests/program/reconstruct_test.py --program build/release/tomofield

A file whose tests were all skipped ends with status 77, which ctest shows as "Skipped"."""

import os
import pathlib
import shutil
import sys

import pytest

TESTS = pathlib.Path(__file__).resolve().parent
PROJECT = TESTS.parent
ALL_SKIPPED = 77

sys.path[:0] = [str(TESTS / "program"), str(TESTS / "docs")]
sys.dont_write_bytecode = True  # the source tree stays as it is
pytest.register_assert_rewrite("harness")


def pytest_addoption(parser):
    parser.addoption("--program", default=PROJECT / "build/release/tomofield", type=pathlib.Path,
                     help="the tomofield to test")
    parser.addoption("--shared-data", default=PROJECT.parent / "shared/data", type=pathlib.Path,
                     help="folder of the real data; tests that need it are skipped without it")


def pytest_configure(config):
    """Tells the harness which program to run."""
    os.environ["TOMOFIELD_PROGRAM"] = str(config.getoption("--program").resolve())


@pytest.fixture(scope="session")
def program(request):
    """Returns the path of the program to test."""
    return str(request.config.getoption("--program").resolve())


@pytest.fixture(scope="session")
def shared_data(request):
    """Returns the folder of the real data, or skips the test where there is none."""
    folder = request.config.getoption("--shared-data").resolve()
    if not folder.is_dir():
        pytest.skip(f"there is no real data: {folder} is no folder")
    return folder


@pytest.fixture(scope="module", autouse=True)
def module_scratch(tmp_path_factory):
    """Gives the harness a folder for the files that the tests of a module share."""
    import harness
    harness.SCRATCH = str(tmp_path_factory.mktemp("shared"))


@pytest.fixture(autouse=True)
def scratch(module_scratch, tmp_path, monkeypatch):
    """Gives the harness a folder of the test's own, and returns it."""
    import harness
    monkeypatch.setattr(harness, "SCRATCH", str(tmp_path))
    return tmp_path


def pytest_sessionfinish(session, exitstatus):
    """Tells ctest when every test was skipped, and removes the scratch folder of good runs."""
    reports = session.config.pluginmanager.get_plugin("terminalreporter").stats
    if exitstatus == pytest.ExitCode.OK and reports.get("skipped") and not reports.get("passed"):
        session.exitstatus = ALL_SKIPPED
    if exitstatus == pytest.ExitCode.OK and session.config.getoption("basetemp"):
        shutil.rmtree(session.config.getoption("basetemp"), ignore_errors=True)
