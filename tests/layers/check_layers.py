#!/usr/bin/python3
"""Checks which folder includes which.

  check_layers.py PROJECT_DIR

A folder of src/ includes itself, the folders above it in src/layers.txt, and the
public headers ("tomofield/..."); sub-folders count as their folder; unit tests
may include helpers of tests/ as well. Public headers include each other and the
standard library only. Prints every offence as
FILE:LINE and exits with status 1 if there is one, 2 where it cannot check.
"""
import pathlib
import re
import sys

SOURCES = {".h", ".cc", ".cu", ".cuh"}
QUOTED_INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')
ANY_INCLUDE = re.compile(r'^\s*#\s*include\s*["<]([^">]+)[">]')


def read_layers(path):
    """Returns the names in layers.txt, lowest first; a line that begins with # is a comment."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def source_files(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in SOURCES and p.is_file())


def includes(path, pattern):
    """Yields (line number, included path) of one file."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        match = pattern.match(line)
        if match:
            yield number, match.group(1)


def offences_in_src(src, tests, layers):
    rank = {name: i for i, name in enumerate(layers)}
    for path in source_files(src):
        layer = path.relative_to(src).parts[0]
        if layer not in rank:
            yield path, 1, f"folder '{layer}' has no place in src/layers.txt"
            continue
        for number, included in includes(path, QUOTED_INCLUDE):
            top = included.split("/")[0]
            is_test_helper = path.stem.endswith("_test") and (tests / included).is_file()
            if top == "tomofield" or is_test_helper:
                continue
            if top not in rank or "/" not in included:
                yield path, number, f'"{included}" is not named from src/ as "folder/file.h"'
            elif rank[top] > rank[layer]:
                yield path, number, f"'{layer}' includes \"{included}\", but '{top}' comes after it"


def offences_in_public_headers(include):
    for path in source_files(include):
        for number, included in includes(path, ANY_INCLUDE):
            is_public = included.startswith("tomofield/")
            is_standard = re.fullmatch(r"[a-z_0-9]+", included) is not None
            if not (is_public or is_standard):
                yield path, number, f"a public header includes '{included}'"


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    project = pathlib.Path(sys.argv[1])
    src, include = project / "src", project / "include"
    num_files = len(source_files(src))
    if num_files == 0:
        print(f"check_layers: no source file under {src}: is this the project?", file=sys.stderr)
        return 2
    layers = read_layers(src / "layers.txt")
    if not layers:
        print(f"check_layers: {src / 'layers.txt'} does not list the layers", file=sys.stderr)
        return 2
    offences = [*offences_in_src(src, project / "tests", layers), *offences_in_public_headers(include)]
    for path, number, what in offences:
        print(f"{path.relative_to(project)}:{number}: {what}")
    print(f"check_layers: {num_files} files of src/, {len(offences)} offences")
    return 1 if offences else 0


if __name__ == "__main__":
    sys.exit(main())
