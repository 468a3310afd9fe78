"""The types of the module: mypy checks the package itself, and programs of users."""

import pathlib
import subprocess
import sys

import pytest

PACKAGE = pathlib.Path(__file__).parents[2] / "python" / "tomofield"
GOOD = """
import numpy as np
import tomofield

project = tomofield.open_project("TS_01/", series="TS_01")
made = tomofield.reconstruct(project, thickness=16, contrast="bright", progress=True)
assert made.tomogram is not None and made.model is not None
size: float = made.tomogram.voxel_size_A
views, tilts = tomofield.read_mrc("s.mrc"), np.loadtxt("s.tlt")
tomofield.reconstruct(views, tilts, pixel_size_A=10, thickness=16)
tomofield.baseline(views, "wbp", [-3.0, 0.0, 3.0], pixel_size_A=10, thickness=16)
mean = float(np.mean(made.tomogram))
row: str = project.settings[0].row
notes: list[str] = project.warnings
again: tomofield.Reconstruction = tomofield.denoise(made, 1.5)
tomofield.baseline("s.mrc", "tv", thickness=16, output="b.mrc",
                   method_options={"iterations": 80, "penalty": "concave", "non_negative": False})
tomofield.export("m.h5", "level.mrc", level="found", voxel_size_A=20)
tomofield.export("m.h5", "cut.mrc", level=(3, -2), particles="particles.star", box=48)
tomofield.export(made.model, "box.mrc", box=made.model.region(2.0), voxel_type="float16")
tomofield.write_mrc("t.mrc", made.tomogram)
tomofield.align("s.mrc", thickness=16, output="a.mrc", progress=lambda p: p.fraction_done < 0.5)
"""
WRONG = {
    'tomofield.reconstruct("s.mrc", thickness="16")': "thickness",
    'tomofield.reconstruct("s.mrc", thicknes=16)': "thicknes",
    'tomofield.reconstruct("s.mrc", contrast="grey")': "contrast",
    'tomofield.baseline("s.mrc", "fbp")': "fbp",
    'tomofield.export("m.h5", "v.mrc", voxel_type="float64")': "voxel_type",
    'tomofield.read_mrc("v.mrc").voxel_size': "voxel_size",
}


@pytest.fixture(name="errors", scope="module")
def make_errors(tmp_path_factory):
    """Returns the errors that mypy finds in the package, in a good program, and in a wrong one."""
    folder = tmp_path_factory.mktemp("types")
    (folder / "good.py").write_text(GOOD)
    (folder / "wrong.py").write_text("import tomofield\n" + "\n".join(WRONG) + "\n")
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--enable-incomplete-feature=Unpack",
         "--cache-dir", folder / "cache", PACKAGE, folder / "good.py", folder / "wrong.py"],
        capture_output=True, text=True, check=False, cwd=PACKAGE.parent)
    assert "Found" in checked.stdout, checked.stdout + checked.stderr
    return [line for line in checked.stdout.splitlines() if ": error:" in line]


def test_the_package_and_good_programs_have_their_types(errors):
    assert [line for line in errors if "wrong.py" not in line] == []


@pytest.mark.parametrize("number, word", enumerate(WRONG.values(), 2))
def test_wrong_programs_are_found(errors, number, word):
    assert any(f"wrong.py:{number}: error" in line and word in line for line in errors), errors
