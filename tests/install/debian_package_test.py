"""Packs what the build folder holds as a Debian package, and looks into it. Nothing is built."""

import gzip
import pathlib
import re
import shutil
import subprocess

import pytest

PROJECT = pathlib.Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not (shutil.which("dpkg-shlibdeps") and shutil.which("file")),
                                reason="the packages of the section 'package' are missing")


def output_of(*command):
    """Returns what a command prints."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture(name="package", scope="module")
def make_package(program, tmp_path_factory):
    """Returns the path of the package of the build folder that has the program."""
    folder = tmp_path_factory.mktemp("package")
    config = pathlib.Path(program).parent / "CPackConfig.cmake"
    output_of("cpack", "-G", "DEB", "--config", str(config), "-B", str(folder))
    packages = list(folder.glob("*.deb"))
    assert len(packages) == 1
    return packages[0]


@pytest.fixture(name="unpacked", scope="module")
def unpack_package(package, tmp_path_factory):
    """Returns a folder with the files of the package."""
    folder = tmp_path_factory.mktemp("unpacked")
    output_of("dpkg-deb", "--extract", str(package), str(folder))
    return folder


def command_pages(program):
    """Returns the names of the man pages: of the program, its commands and the commands of these."""
    pages, pending = [], [()]
    while pending:
        words = pending.pop()
        pages.append("-".join(("tomofield", *words)) + ".1.gz")
        _, _, listed = output_of(program, *words, "--help").partition("\nSubcommands:\n")
        pending += [(*words, name) for name in re.findall(r"^  ([a-z][a-z-]*)", listed, re.MULTILINE)]
    return pages


def test_the_package_has_the_program_and_its_documents_alone(program, unpacked):
    files = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    assert files == {
        "usr/bin/tomofield",
        "usr/share/tomofield/materials.txt",
        "usr/share/doc/tomofield/CHANGELOG.md.gz",
        "usr/share/doc/tomofield/changelog.gz",
        "usr/share/doc/tomofield/copyright",
        *(f"usr/share/man/man1/{page}" for page in command_pages(program)),
    }


def test_files_belong_to_root_and_only_the_program_is_executable(package):
    for line in output_of("dpkg-deb", "--contents", str(package)).splitlines():
        mode, owner, *_, path = line.split()
        executable = path.endswith("/") or path == "./usr/bin/tomofield"
        assert (mode[1:], owner) == ("rwxr-xr-x" if executable else "rw-r--r--", "root/root"), path


def test_the_program_is_stripped_and_runs(program, unpacked):
    installed = unpacked / "usr/bin/tomofield"
    assert ", stripped" in output_of("file", str(installed))
    assert output_of(str(installed), "--version") == output_of(program, "--version")
    materials = (unpacked / "usr/share/tomofield/materials.txt").read_text(encoding="utf-8")
    assert materials.strip() in output_of(str(installed), "--version", "--verbose")


def test_the_fields_name_what_apt_asks_for(program, package):
    field = lambda name: output_of("dpkg-deb", "--field", str(package), name).strip()
    version = re.match(r"tomofield (\S+)", output_of(program, "--version")).group(1)
    assert package.name == f"tomofield_{version}_{field('Architecture')}.deb"
    assert (field("Package"), field("Version"), field("Section")) == ("tomofield", version, "science")
    depends = {name.split()[0] for name in field("Depends").split(", ")}
    loaded = {line.split()[0] for line in output_of(program, "--version", "--verbose").splitlines()
              if re.match(r"[a-z0-9.+-]+ \S+: ", line)}
    assert {"libc6", "libstdc++6"} < depends <= loaded


def test_the_copyright_file_has_the_licence_and_those_of_compiled_headers(unpacked):
    docs = unpacked / "usr/share/doc/tomofield"
    copyright_text = (docs / "copyright").read_text(encoding="utf-8")
    assert copyright_text.startswith((PROJECT / "LICENSE").read_text(encoding="utf-8"))
    for package in ("nlohmann-json3-dev", "libeigen3-dev", "gemmi-dev"):
        licence = pathlib.Path(f"/usr/share/doc/{package}/copyright").read_text(encoding="utf-8")
        assert licence in copyright_text, package


def test_the_changelogs_name_the_version_and_what_has_changed(package, unpacked):
    docs = unpacked / "usr/share/doc/tomofield"
    version = output_of("dpkg-deb", "--field", str(package), "Version").strip()
    with gzip.open(docs / "changelog.gz", "rt", encoding="utf-8") as changelog:
        assert changelog.readline().startswith(f"tomofield ({version}) ")
    with gzip.open(docs / "CHANGELOG.md.gz", "rt", encoding="utf-8") as changes:
        assert changes.read() == (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")
