"""The Python layer takes arrays of any real type and layout, and refuses all others in a sentence."""

import pathlib
import subprocess
import sys

SEEDS = 300
HANGS_AFTER = 600  # seconds


def test_any_array_is_answered_or_refused(series, program):
    """A child of its own tries the arrays, since what they may do is to crash it."""
    cases = pathlib.Path(__file__).with_name("array_cases.py")
    tried = subprocess.run(
        [sys.executable, cases, "1", str(SEEDS), series.folder / "tomogram.h5",
         pathlib.Path(program).parent / "python"], capture_output=True, text=True,
        timeout=HANGS_AFTER)
    assert tried.returncode == 0, (tried.returncode, tried.stderr[-2000:])
    calls, answered, refused = (int(word) for word in tried.stdout.split() if word.isdigit())
    assert calls == 4 * SEEDS and answered > calls // 8 and refused > calls // 8, tried.stdout
