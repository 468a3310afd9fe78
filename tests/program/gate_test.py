"""Runs bench/gate: the program still makes what its users have seen. Series whose data are absent
are skipped."""

import os
import subprocess
import sys

import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import gate_cases  # pylint: disable=wrong-import-position

SKIPPED = 77


@pytest.mark.parametrize("case", (*gate_cases.CASES, "readme"))
def test_the_program_makes_what_is_expected(case, request):
    command = ["/usr/bin/python3", os.path.join(BENCH, "gate"), harness.fresh_directory("gate"),
               "--only", f"^{case}$", "--program", harness.PROGRAM,
               "--data", str(request.config.getoption("--shared-data").resolve())]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode == SKIPPED:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout + done.stderr
