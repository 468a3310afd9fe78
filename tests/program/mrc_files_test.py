"""`tomofield info` on MRC files that mrcfile wrote, and on damaged ones.

Usage: mrc_files_test.py TOMOFIELD SCRATCH_DIRECTORY
"""
import os
import subprocess
import sys

try:
    import mrcfile
    import numpy as np
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

tomofield, scratch = sys.argv[1:3]
os.makedirs(scratch, exist_ok=True)
os.chdir(scratch)


def info(*arguments):
    """Exit status and output of `tomofield info`."""
    run = subprocess.run([tomofield, "info", *arguments], capture_output=True, text=True)
    return run.returncode, run.stdout, run.stderr


def expect_refusal(parts, *arguments):
    status, _, errors = info(*arguments)
    assert status == 2, (arguments, status, errors)
    for part in parts:
        assert part in errors, (part, errors)


rng = np.random.default_rng(1)
names = {0: "8-bit", 1: "16-bit integers", 2: "32-bit floats", 6: "unsigned", 12: "16-bit floats"}
for mode, dtype in {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}.items():
    with mrcfile.new("stack.mrc", overwrite=True) as m:
        m.set_data(rng.integers(0, 100, (3, 20, 30)).astype(dtype))
        m.set_image_stack()
        m.voxel_size = 13.25
        m.add_label("a label of this test")
    status, output, errors = info("stack.mrc")
    assert status == 0, errors
    for part in ("image stack", "30 × 20 × 3", names[mode], "13.25", "a label of this test"):
        assert part in output, (part, output)

# As a tilt series: one line a view.
with open("good.tlt", "w") as f:
    f.write("-30\n0\n30.5\n")
status, output, errors = info("stack.mrc", "--tlt", "good.tlt", "--exclude", "2")
assert status == 0, errors
assert "2 views" in output and "30.50" in output, output

with open("short.tlt", "w") as f:
    f.write("-30\n0\n")
expect_refusal(["short.tlt", "2 angles", "stack.mrc", "3 sections"], "stack.mrc", "--tlt", "short.tlt")
with open("steep.tlt", "w") as f:
    f.write("-30\n0\n81\n")
expect_refusal(["steep.tlt", "line 3", "81"], "stack.mrc", "--tlt", "steep.tlt")
expect_refusal(["absent.tlt"], "stack.mrc", "--tlt", "absent.tlt")
expect_refusal(["--log"], "stack.mrc", "--tlt", "good.tlt", "--contrast", "bright", "--log")
assert info("stack.mrc", "--contrast", "grey")[0] == 2

# Damaged and foreign files.
whole = open("stack.mrc", "rb").read()
open("torn.mrc", "wb").write(whole[:2000])
expect_refusal(["torn.mrc", str(len(whole)), "2000"], "torn.mrc")
open("empty.mrc", "wb").close()
expect_refusal(["empty.mrc", "0 bytes"], "empty.mrc")
open("text.mrc", "wb").write(b"no MRC file at all " * 100)
expect_refusal(["text.mrc"], "text.mrc")
open("model.h5", "wb").write(b"\x89HDF\r\n\x1a\n" + bytes(2000))
expect_refusal(["model.h5"], "model.h5")
expect_refusal(["absent.mrc"], "absent.mrc")
expect_refusal([scratch], scratch)
