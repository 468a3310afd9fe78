"""Tests that a run in which a call of the system fails, that is killed or whose disk fills up says one
sentence, leaves old or new files, and is repeated with the same bits. `python3
tests/program/faults.py` tries every call; these tests try some of each kind."""

import errno
import os

import pytest

import faults
import harness


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Returns the runs of which single calls fail."""
    if harness.is_sanitized():
        pytest.skip("the sanitizers have calls of their own")
    folder = tmp_path_factory.mktemp("faults")
    library = faults.build(folder)
    if library is None:
        pytest.skip("there is no C compiler")
    return faults.Sweep(folder, library)


@pytest.mark.parametrize("kind", faults.KINDS)
def test_a_call_that_fails_ends_in_one_sentence(kind, sweep):
    count = sweep.count(kind)
    assert count > 5, "the library sees the calls"
    ends = [sweep.check(faults.Fault(kind, number, mode), has_old_results).returncode
            for number, mode, has_old_results in ((count // 3, "once", True), (2, "from", False),
                                                  (count - 1, "from", True))]
    assert any(ends), "no fault was noticed"


@pytest.mark.parametrize("kind, mode, error", faults.SERVER)
def test_a_file_server_that_fails_takes_nothing_away(kind, mode, error, sweep):
    count = sweep.count(kind)
    for i, number in enumerate(faults.moments(count, 4)):
        ended = sweep.check(faults.Fault(kind, number, mode, error), i % 2 == 0)
        assert ended.returncode in (0, 2), (number, ended)
        if ended.returncode == 2:
            assert sweep.scratch in ended.stderr and os.strerror(error) in ended.stderr, ended
        if mode.endswith("done"):
            assert ended.returncode == 0, (number, ended)  # what was renamed is renamed


def test_memory_that_ends_before_a_checkpoint_ends_in_one_sentence(sweep):
    # HDF5 crashes if it cannot allocate what it takes for a file. The first ones are the exception
    # that docs/results/reliability.md describes.
    count = sweep.count("allocate")
    for number in range(count // 2 + 1, count, 2):
        assert sweep.check(faults.Fault("allocate", number, "from"), False).returncode in (0, 2)


def test_no_write_of_a_result_fails_unnoticed(sweep):
    # The values of a small array of a model are written when HDF5 closes it.
    for number in range(1, sweep.count("write") + 1, 12)[-10:]:
        sweep.check(faults.Fault("write", number, "once"), True)


def test_each_result_that_cannot_be_written_is_named(sweep):
    for name in sweep.new:
        sweep.prepare(True)
        fault = faults.Fault("write", 1, "from", errno.EIO)
        ended = sweep.run(fault, "--overwrite", below=os.path.join(sweep.folder(), f".{name}"))
        sweep.check_end(ended, fault)
        sweep.check_files(ended, fault, True)
        assert ended.returncode == 2 and name in ended.stderr, (name, ended)


def test_a_killed_run_leaves_whole_files(sweep):
    count = sweep.count("io")
    for i, number in enumerate(faults.moments(count - 1, 6)):
        killed = sweep.check(faults.Fault("io", number, "kill"), i % 2 == 1)
        assert killed.returncode == -9, number


def test_a_full_disk_ends_in_one_sentence(sweep):
    if not faults.can_mount():
        pytest.skip("only root can mount a small disk")
    for has_old_results in (False, True):
        for size in faults.disk_sizes(sweep, has_old_results, 3)[:2]:
            ended = faults.check_full_disk(sweep, size, has_old_results)
            assert ended.returncode == 2, (size, ended)


def test_a_store_is_never_lost(sweep):
    """A file that cannot be looked at is not absent."""
    sweep.prepare(True)
    folder = os.path.join(sweep.scratch, "store")
    counted = os.path.join(sweep.scratch, "count")
    command = ["export", sweep.results.model_path, "--zarr", "--overwrite", "-o",
               os.path.join(folder, "out.mrc")]
    os.makedirs(folder)
    sweep.harness.succeed(*command)
    before = sweep.harness.contents(folder)

    def run(number, mode="once"):
        fault = faults.Fault("stat", number, mode, errno.ESTALE)
        return sweep.harness.tomofield(*command, timeout=60,
                                       env=fault.environment(sweep.library, folder, counted))

    assert run(0).returncode == 0
    with open(counted, encoding="ascii") as file:
        count = int(file.read())
    assert count > 20
    for number in range(1, count + 1, 2):
        for mode in ("once", "from"):
            ended = run(number, mode)
            assert ended.returncode in (0, 2), (number, mode, ended)
            assert set(before) <= set(sweep.harness.contents(folder)), (number, mode, ended)
