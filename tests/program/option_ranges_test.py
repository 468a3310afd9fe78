"""Tests that a run with the smallest or the largest value of any option ends, is refused, or obeys a
signal: the values are those that docs/options.md states."""

import pathlib
import re
import resource
import signal
import subprocess

import pytest

import harness

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/options.md"
ROW = re.compile(r"^\| `([^`]+)` \| ([^|]+) \|", re.MULTILINE)
RANGE = re.compile(r"(?:0 or )?from (\S+) to (\d+)")
LARGEST = "1000000000"  # of options that state no other
# An option that counts only beside others.
BESIDE = {"--cs": ["--defocus", 3], "--amplitude-contrast": ["--defocus", 3],
          "--voltage": ["--defocus", 3], "--leaf-budget": ["--tree", "adaptive"],
          "--ray-samples": ["--engine", "ray"], "--early-stop": ["--hold-out", 3],
          "--tile-rows": ["--budget", "1MB"], "--log-base": ["--log"]}


def ends():
    """Returns every numeric option of the page with the two ends of its range."""
    found = []
    for flags, values in ROW.findall(PAGE.read_text("utf-8")):
        flag = flags.split(",")[-1].strip()
        if stated := RANGE.match(values):
            found += [(flag, stated[1]), (flag, stated[2])]
        elif re.match(r"\d or more", values):
            found += [(flag, values[0]), (flag, LARGEST)]
        elif values.startswith("a multiple of 16"):
            found += [(flag, "16"), (flag, "4096")]
    return found


def test_the_page_states_the_ranges():
    found = dict(ends())
    assert len(found) > 35 and found["--ray-samples"] == "32768" and found["--rank"] == "256", found


@pytest.fixture(scope="module")
def series():
    return harness.Series("series")


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))


@pytest.mark.parametrize("flag, value", ends())
def test_the_end_of_a_range_ends_or_stops(series, flag, value, tmp_path):
    words = ["--thickness", harness.THICKNESS, "--contrast", "bright", *BESIDE.get(flag, []),
             f"{flag}={value}"]
    run = harness.start("reconstruct", *series.input, *harness.merge(words[:4], words[4:]), "-o",
                        tmp_path / "out.mrc",
                        preexec_fn=None if harness.is_sanitized() else limit_memory)
    try:
        _, said = run.communicate(timeout=0.7)
    except subprocess.TimeoutExpired:
        run.send_signal(signal.SIGTERM)
        _, said = run.communicate(timeout=60)
    # Before it has begun, the signal itself ends it.
    assert run.returncode in (0, 2, 128 + signal.SIGTERM, -signal.SIGTERM), (run.returncode, said)
    assert run.returncode <= 0 or said.splitlines()[-1].startswith("tomofield: "), said
    assert "internal error" not in said and "bad_alloc" not in said, said
