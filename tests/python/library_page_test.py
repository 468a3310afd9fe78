"""The snippets of docs/library.md run, or are part of an example that the install test builds; the
types of the compiled part are those that _core.pyi names."""

import ast
import pathlib
import re
import subprocess

import pytest

import tomofield

PROJECT = pathlib.Path(__file__).parents[2]


def snippets(language):
    text = (PROJECT / "docs" / "library.md").read_text(encoding="utf-8")
    found = re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert found, f"no snippet of {language}"
    return found


def test_python_snippets_run(program, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    subprocess.run([program, "simulate", ".", "--size", "32", "--thickness", "75",
                    "--noise", "0.05", "--seed", "1"], check=True, capture_output=True)
    names = {}
    for snippet in snippets("python"):
        exec(snippet, names)
    assert names["made"].tomogram.shape == (75, 32, 32)
    assert names["record"].metrics["verdict"]["residual"] > 0
    assert names["coarse"].voxel_size_A == 20
    assert names["scores"].psnr_affine_dB > 15


@pytest.mark.parametrize("snippet", snippets("cpp"))
def test_cpp_snippets_are_parts_of_examples(snippet):
    assert any(snippet in path.read_text() for path in (PROJECT / "examples").glob("*.cc"))


def test_cmake_snippets_are_of_examples():
    text = (PROJECT / "examples" / "CMakeLists.txt").read_text()
    text = text.replace("${example}", "reconstruct_stack")
    for snippet in snippets("cmake"):
        for line in snippet.splitlines():
            assert line.strip() in text


def test_the_stub_names_what_the_compiled_part_has():
    stub = PROJECT / "python" / "tomofield" / "_core.pyi"
    tree = ast.parse(stub.read_text())
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    values = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    public = {name for name in vars(tomofield._core) if not name.startswith("_")}
    assert functions | values - {"__version__"} | {node.name for node in classes} == public
    for node in classes:
        core = getattr(tomofield._core, node.name)
        named = {item.name for item in node.body if isinstance(item, ast.FunctionDef)
                 and not item.name.startswith("_")}
        has = {name for name in vars(core) if not name.startswith("_")}
        if node.name == "Choices":  # the options have types of their own (options.py)
            has -= {"stack", *tomofield.Options.__annotations__}
        if node.name not in ("Error", "BaselineMethod"):
            assert named == has
