"""Tests that a run goes on when what it says cannot be written, and that the status tells when what
it prints is its result."""

import os
import subprocess

import pytest

import harness
from harness import PROGRAM, QUICK


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module")
def undisturbed(series):
    """Returns the results of a run whose messages can be written."""
    return series.reconstruct("undisturbed")


def run(command, redirection):
    """Runs the program with a redirection of the shell, and returns the run and its errors."""
    words = ["/bin/sh", "-c", f'exec "$@" {redirection}', "sh", PROGRAM, *map(str, command)]
    return subprocess.run(words, capture_output=True, text=True)


@pytest.mark.parametrize("redirection", ["2>/dev/full", "2>&-", ">/dev/full", ">&-", "<&- >&- 2>&-",
                                         ">/dev/full 2>&1"])
def test_a_run_goes_on_without_its_messages(redirection, series, undisturbed):
    results = harness.fresh_results("silent")
    ended = run(["reconstruct", *series.input, *QUICK, "-o", results.volume_path], redirection)
    assert ended.returncode == 0, ended
    assert results.same_as(undisturbed)
    assert not results.leftovers(), results.leftovers()
    if "2>" not in redirection:
        assert "warning: what was printed cannot be written" in ended.stderr, ended.stderr


def test_a_run_goes_on_when_nobody_reads_its_messages(series, undisturbed):
    results = harness.fresh_results("pipe")
    reader, writer = os.pipe()
    os.close(reader)
    ended = subprocess.run([PROGRAM, "reconstruct", *series.input, *map(str, QUICK), "-o",
                            results.volume_path], stdout=writer, stderr=writer)
    os.close(writer)
    assert ended.returncode == 0
    assert results.same_as(undisturbed)


@pytest.mark.parametrize("redirection", [">/dev/full", ">&-"])
def test_a_result_that_cannot_be_printed_is_a_failure(redirection, series, undisturbed):
    for command in (["info", series.stack], ["info", undisturbed.model_path],
                    ["evaluate", undisturbed.volume_path], ["--help"], ["reconstruct", "--help"],
                    ["--version"], ["reconstruct", *series.input, *QUICK, "--dry-run", "-o",
                                    os.path.join(harness.SCRATCH, "never.mrc")]):
        ended = run(command, redirection)
        assert ended.returncode == 1, (command, ended)
        last = ended.stderr.splitlines()[-1]
        assert last.startswith("tomofield: what was printed cannot be written: "), last
        assert harness.tomofield(*command).returncode == 0, command
