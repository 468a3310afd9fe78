"""The notebook of examples/ runs from its first cell to the last, and draws its figures."""

import json
import os
import pathlib
import shutil
import subprocess

import pytest

import tomofield

NOTEBOOK = pathlib.Path(__file__).parents[2] / "examples" / "notebook.ipynb"


@pytest.fixture(scope="module")
def cells(program, tmp_path_factory):
    """Returns the cells of the notebook after jupyter has executed it."""
    folder = tmp_path_factory.mktemp("notebook")
    shutil.copy(NOTEBOOK, folder)
    module = os.path.dirname(os.path.dirname(tomofield.__file__))
    environment = {**os.environ, "PYTHONPATH": module, "JUPYTER_PLATFORM_DIRS": "0",
                   "IPYTHONDIR": str(folder / "ipython"), "MPLCONFIGDIR": str(folder / "matplotlib"),
                   "PATH": os.path.dirname(program) + os.pathsep + os.environ["PATH"]}
    done = subprocess.run(["jupyter", "nbconvert", "--execute", "--to", "notebook", "--output",
                           "done.ipynb", "--ExecutePreprocessor.timeout=1200", NOTEBOOK.name],
                          cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "done.ipynb").read_text(encoding="utf-8"))["cells"]


def outputs(cells, kind):
    return [output["data"][kind] for cell in cells if cell["cell_type"] == "code"
            for output in cell["outputs"] if kind in output.get("data", {})]


def test_the_notebook_has_ten_cells_without_stored_outputs():
    stored = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert len(stored) == 10
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in stored)


def test_every_cell_runs_and_shows_something(cells):
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"], cell["source"]
            kinds = {output["output_type"] for output in cell["outputs"]}
            assert "error" not in kinds
    warned = [output["text"] for cell in cells for output in cell.get("outputs", [])
              if output.get("name") == "stderr" and "Warning" in "".join(output["text"])]
    assert warned == []
    assert len(outputs(cells, "image/png")) == 7  # figures
    html = "".join("".join(text) for text in outputs(cells, "text/html"))
    assert "data:image/png;base64," in html and "verdict: residual" in html


def test_tomofield_is_closer_to_the_truth_than_back_projection(cells):
    text = "".join("".join(output.get("text", "")) for cell in cells
                   for output in cell.get("outputs", []))
    crossing = {line.split(":")[0]: float(line.split()[-2]) for line in text.splitlines()
                if ": 0.7 at " in line}
    assert crossing["tomofield"] < crossing["weighted back-projection"]
