"""Holds packages.txt and what uses its packages together.

A machine that has all packages cannot show that a section lacks one. So these tests ask which files of
the system were used, and which package each of them belongs to."""

import ast
import importlib.util
import os
import pathlib
import re
import subprocess
import sys

import pytest

PROJECT = pathlib.Path(__file__).resolve().parents[2]
DPKG = pathlib.Path("/var/lib/dpkg/info")

pytestmark = pytest.mark.skipif(not DPKG.is_dir(), reason="there is no dpkg")


def read_sections():
    """Returns the packages of each section of packages.txt."""
    sections = {}
    for line in (PROJECT / "packages.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            packages = sections.setdefault(line.strip("[]"), [])
        elif line and not line.startswith("#"):
            packages.append(line.split()[0])
    return sections


SECTIONS = read_sections()


def read_dependencies():
    """Returns the packages that each installed package, or one that stands for others, depends on."""
    shown = subprocess.run(
        ["dpkg-query", "-W", "-f", "${Package}\t${Provides}\t${Pre-Depends}, ${Depends}\n"],
        capture_output=True, text=True, check=True).stdout

    def names(text):
        return re.findall(r"(?:^|[,|])\s*([a-z0-9][a-z0-9.+-]*)", text)

    dependencies = {}
    for line in shown.splitlines():
        package, provided, needed = line.split("\t")
        dependencies.setdefault(package, set()).update(names(needed))
        for name in names(provided):
            dependencies.setdefault(name, set()).add(package)
    return dependencies


@pytest.fixture(name="files_of", scope="module")
def make_files_of():
    """Returns a function that gives the files of the packages of sections and of all that they need."""
    dependencies = read_dependencies()

    def files_of(*sections):
        pending = [package for section in sections for package in SECTIONS[section]]
        found = set()
        while pending:
            package = pending.pop()
            if package not in found:
                found.add(package)
                pending += dependencies.get(package, ())
        return set().union(*map(files_of_package, found))

    return files_of


def files_of_package(package):
    """Returns the real paths of the files of an installed package."""
    lists = [*DPKG.glob(f"{package}.list"), *DPKG.glob(f"{package}:*.list")]
    lines = [line for file in lists for line in file.read_text(encoding="utf-8").splitlines()]
    return {os.path.realpath(line) for line in lines}


@pytest.fixture(name="headers", scope="module")
def make_headers(program):
    """Returns the headers of the system that each object of the build folder was compiled with."""
    shown = subprocess.run(["ninja", "-C", os.path.dirname(program), "-t", "deps"],
                           capture_output=True, text=True, check=True).stdout
    headers, real = {}, {}
    for line in shown.splitlines():
        if line.startswith(" "):
            path = line.strip()
            if path.startswith("/usr/"):
                used.add(real.setdefault(path, os.path.realpath(path)))
        elif line:
            used = headers.setdefault(line.split(":")[0], set())
    assert headers, "the build folder knows no objects"
    return headers


def headers_below(headers, *folders):
    """Returns the headers of the objects in some folders of the build; without folders, of the others
    than tests, benches and the Python module: those of the program."""
    others = ("tests/", "bench/", "python/", "fuzz/")
    chosen = [used for target, used in headers.items()
              if (target.startswith(folders) if folders else not target.startswith(others))]
    return set().union(*chosen)


def test_the_program_needs_its_sections_alone(headers, files_of):
    used = headers_below(headers)
    assert used and used - files_of("build", "program") == set()


def test_the_program_needs_each_package_of_its_section(headers):
    used = headers_below(headers)
    assert [name for name in SECTIONS["program"] if not used & files_of_package(name)] == []


@pytest.mark.parametrize("folders, sections", (
    (("tests/", "bench/"), ("build", "program", "tests")),
    (("python/",), ("build", "program", "python")),
), ids=("tests", "python"))
def test_other_targets_need_their_sections_alone(folders, sections, headers, files_of):
    used = headers_below(headers, *folders)
    if not used:
        pytest.skip(f"nothing of {folders} was built")
    assert used - files_of(*sections) == set()


def imported_modules():
    """Returns the modules of others that the Python files of the tests and the module import."""
    files = [*PROJECT.glob("tests/**/*.py"), *PROJECT.glob("python/**/*.py")]
    local = {file.stem for file in [*files, *PROJECT.glob("bench/*.py")]} | {"tomofield"}
    names = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names.update(alias.name.split(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.split(".")[0])
    return sorted(names - local - set(sys.stdlib_module_names))


def test_the_tests_import_modules_of_their_sections_alone(files_of):
    listed = files_of("python", "tests")
    modules = imported_modules()
    places = {name: importlib.util.find_spec(name) for name in modules}
    assert "numpy" in modules
    assert [name for name, place in places.items()
            if place is None or os.path.realpath(place.origin) not in listed] == []


def test_scripts_ask_for_sections_that_exist():
    for script in ("demo", "test", ".ci/run", ".ci/bookworm", ".ci/trixie", "tools/package",
                   "tools/portable", "tools/release"):
        asked = re.findall(r"^\s*install_packages (.*)$",
                           (PROJECT / script).read_text(encoding="utf-8"), re.MULTILINE)
        assert asked, script
        assert {name for line in asked for name in line.split()} <= set(SECTIONS), script
