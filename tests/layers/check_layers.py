#!/usr/bin/python3
"""Checks which room of src/ includes which.

  check_layers.py PROJECT_DIR

A file includes its own room, the rooms that the line of its room in src/layers.txt names, and the
public headers ("tomofield/..."); sub-folders count as their room. A line names no room that no file
of its room includes. Unit tests may include any room above theirs in src/layers.txt, and helpers of
tests/. Public headers include each other and the standard library only. docs/architecture.md has the
drawing of the graph. No folder of src/ has more files or lines, without its unit tests, than LIMITS
and OTHER_LIMITS say. Few modules are small: a module is a header with the sources that include it
first, as those of backends do. The endings of the names of a run's files stand in
src/output/output_paths.cc alone. Prints every offence as FILE:LINE and exits with status 1 if there is one, 2
where it cannot check.
"""
import pathlib
import re
import sys

from rooms import BadGraph, read_rooms, with_drawing

LIMITS = 40, 5000  # files and lines of a folder
OTHER_LIMITS = {"reconstruct": (18, 1900)}  # the run alone

SMALL_MODULE, MOST_SMALL = 60, 0.05  # lines, and the part of the modules that may have fewer
MANY_MODULES = 100  # a smaller project may have any
RESULT_NAMES = pathlib.Path("output", "output_paths.cc")
RESULT_NAME = re.compile(r'"(_\w+\.\w+)"')

JSON_ROOMS = {"io", "option_table"}  # readers of files, and the values of options
JSON_HEADER = re.compile(r'^\s*#\s*include\s*["<](io/json\.h|nlohmann/.*)[">]')
JSON_WORD = re.compile(r"\bnlohmann\b")

SOURCES = {".h", ".cc", ".cu", ".cuh"}
QUOTED_INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')
ANY_INCLUDE = re.compile(r'^\s*#\s*include\s*["<]([^">]+)[">]')


def source_files(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in SOURCES and p.is_file())


def is_test(path):
    return path.stem.endswith("_test")


def includes(path, pattern):
    """Yields (line number, included path) of one file."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        match = pattern.match(line)
        if match:
            yield number, match.group(1)


def rooms_above(rooms):
    """Returns {room: the rooms above it in layers.txt}, which its unit tests may include."""
    names = list(rooms)
    return {room: names[:i] for i, room in enumerate(names)}


def offences_in_src(src, tests, rooms):
    above = rooms_above(rooms)
    for path in source_files(src):
        room = path.relative_to(src).parts[0]
        if room not in rooms:
            yield path, 1, f"folder '{room}' has no line in src/layers.txt"
            continue
        allowed = above[room] if is_test(path) else rooms[room]
        for number, included in includes(path, QUOTED_INCLUDE):
            top = included.split("/")[0]
            is_test_helper = is_test(path) and (tests / included).is_file()
            if top == "tomofield" or is_test_helper:
                continue
            if top not in rooms or "/" not in included:
                yield path, number, f'"{included}" is not named from src/ as "room/file.h"'
            elif top != room and top not in allowed:
                yield (path, number,
                       f"'{room}' includes \"{included}\": its line does not name '{top}'")


def line_of(text, room):
    return next(i for i, line in enumerate(text.splitlines(), 1) if line.startswith(f"{room}:"))


def stale_entries(src, rooms):
    """Yields the rooms that a line names and no file of its room includes."""
    layers = src / "layers.txt"
    for room, named in rooms.items():
        files = [path for path in source_files(src / room) if not is_test(path)]
        used = {top.split("/")[0] for path in files for _, top in includes(path, QUOTED_INCLUDE)}
        number = line_of(layers.read_text(encoding="utf-8"), room)
        if not files:
            yield layers, number, f"'{room}' has no source file"
        for other in named:
            if other not in used:
                yield (layers, number,
                       f"no file of '{room}' includes '{other}': remove it from the line")


def offences_in_size(src):
    files = {}
    for path in source_files(src):
        if not is_test(path):
            files.setdefault(path.parent, []).append(path)
    for folder, paths in files.items():
        most_files, most_lines = OTHER_LIMITS.get(str(folder.relative_to(src)), LIMITS)
        num_lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)
        if len(paths) > most_files:
            yield folder, 1, f"{len(paths)} files in a folder are more than {most_files}: divide it"
        if num_lines > most_lines:
            yield folder, 1, f"{num_lines} lines in a folder are more than {most_lines}: divide it"


def module_of(path, src):
    """Returns the header of a module, without extension, relative to src/."""
    own = path.with_suffix(".h")
    if path.suffix == ".h" or own.is_file():
        return str(own.relative_to(src).with_suffix(""))
    first = next((included for _, included in includes(path, QUOTED_INCLUDE)), None)
    return str(pathlib.Path(first or path.relative_to(src)).with_suffix(""))


def offences_in_modules(src):
    lines = {}
    for path in source_files(src):
        if not is_test(path):
            module = module_of(path, src)
            num_lines = len(path.read_text(encoding="utf-8").splitlines())
            lines[module] = lines.get(module, 0) + num_lines
    small = sorted(module for module, num in lines.items() if num < SMALL_MODULE)
    if len(lines) >= MANY_MODULES and len(small) > MOST_SMALL * len(lines):
        yield (src, 1, f"{len(small)} of {len(lines)} modules have fewer than {SMALL_MODULE} lines: "
                       f"join some of {', '.join(small)} with those that use them")


def offences_in_result_names(src):
    home = src / RESULT_NAMES
    names = set(RESULT_NAME.findall(home.read_text(encoding="utf-8"))) if home.is_file() else set()
    for path in source_files(src):
        if path == home or is_test(path):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            for name in names.intersection(RESULT_NAME.findall(line)):
                yield path, number, f"'{name}' is a name of a run's file: take it from {RESULT_NAMES}"


def offences_in_json(src):
    for path in source_files(src):
        if path.relative_to(src).parts[0] in JSON_ROOMS or path.stem.endswith("_record") \
                or is_test(path):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if JSON_HEADER.match(line) or JSON_WORD.search(line):
                yield (path, number, "JSON belongs to a record: read and write it in a source "
                                     "called NAME_record")


def offences_in_public_headers(include):
    for path in source_files(include):
        for number, included in includes(path, ANY_INCLUDE):
            is_public = included.startswith("tomofield/")
            is_standard = re.fullmatch(r"[a-z_0-9]+", included) is not None
            if not (is_public or is_standard):
                yield path, number, f"a public header includes '{included}'"


def offences_in_drawing(page, rooms):
    text = page.read_text(encoding="utf-8")
    drawn = with_drawing(text, rooms)
    if drawn is None:
        yield page, 1, "there is no place for the drawing of the rooms, between two marks"
    elif drawn != text:
        yield page, 1, "the drawing of the rooms is out of date: run tools/draw_rooms"


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    project = pathlib.Path(sys.argv[1])
    src = project / "src"
    num_files = len(source_files(src))
    if num_files == 0:
        print(f"check_layers: no source file under {src}: is this the project?", file=sys.stderr)
        return 2
    try:
        rooms = read_rooms(src / "layers.txt")
    except (BadGraph, OSError) as fault:
        print(f"{src / 'layers.txt'}:{fault}", file=sys.stderr)
        return 2
    offences = [*offences_in_src(src, project / "tests", rooms), *stale_entries(src, rooms),
                *offences_in_size(src), *offences_in_modules(src),
                *offences_in_result_names(src), *offences_in_json(src),
                *offences_in_public_headers(project / "include"),
                *offences_in_drawing(project / "docs" / "architecture.md", rooms)]
    for path, number, what in offences:
        print(f"{path.relative_to(project)}:{number}: {what}")
    print(f"check_layers: {num_files} files of src/, {len(offences)} offences")
    return 1 if offences else 0


if __name__ == "__main__":
    sys.exit(main())
