"""Tests the software bill of materials that the program prints."""

import os
import shutil
import subprocess

import pytest

import harness
from harness import PROGRAM


def bill():
    """Returns what --version --verbose prints below the version."""
    version = harness.succeed("--version").stdout
    for order in (["--version", "--verbose"], ["--verbose", "--version"]):
        shown = harness.succeed(*order).stdout
        assert shown.startswith(version), shown
    return shown[len(version):]


def test_every_library_that_the_program_loads_is_listed():
    if not shutil.which("dpkg-query"):
        assert "without dpkg" in bill()
        pytest.skip("there is no dpkg")
    listed = {line.split()[0]: line for line in bill().splitlines() if ": " in line}
    loaded = subprocess.run(["ldd", PROGRAM], capture_output=True, text=True, check=True).stdout
    paths = [os.path.realpath(line.split()[2]) for line in loaded.splitlines() if "=> /" in line]
    assert paths
    for path in paths:
        owner = subprocess.run(["dpkg-query", "-S", path, path.removeprefix("/usr")],
                               capture_output=True, text=True).stdout.split(":")[0]
        if owner:  # else somebody built it here
            assert owner in listed, path
    version = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "libcli11-dev"],
                             capture_output=True, text=True).stdout
    if version:
        assert listed["libcli11-dev"] == f"libcli11-dev {version}: BSD-3-clause"


def test_a_program_without_its_bill_says_so(scratch):
    program = shutil.copy(PROGRAM, scratch / "tomofield")
    shown = subprocess.run([program, "--version", "--verbose"], capture_output=True, text=True)
    assert shown.returncode == 0 and f"'{scratch}/materials.txt' is missing" in shown.stdout, shown


def test_verbose_without_version_is_refused():
    refused = harness.tomofield("--verbose")
    assert refused.returncode == 2 and "--version" in refused.stderr, refused
