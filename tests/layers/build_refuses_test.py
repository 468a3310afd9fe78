#!/usr/bin/python3
"""Shows that the build refuses an include of a room that is out of reach.

  build_refuses_test.py PROJECT_DIR BUILD_DIR

Preprocesses a probe with each room's own command line, as compile_commands.json has it: it finds the
headers of the room, of those that its line in src/layers.txt names, and of those that their headers
may include in turn. It finds none of another room.
"""
import json
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest

from rooms import reached, read_rooms

PROJECT, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
SRC = PROJECT / "src"
ROOMS = read_rooms(SRC / "layers.txt")
REACHED = reached(ROOMS)


def command_of(room):
    """Returns the words that compile sources of this room, without the source and the output."""
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        words = shlex.split(entry["command"])
        if f"-I{BUILD}/layers/{room}/src" in words:
            return words[:words.index("-o")]
    raise AssertionError(f"no source of {room} is compiled")


def header_of(room):
    """Returns a header of a room, or None: a room of public functions has none of its own."""
    header = next((SRC / room).rglob("*.h"), None)
    return header and str(header.relative_to(SRC))


def preprocess(room, text):
    with tempfile.TemporaryDirectory() as scratch:
        probe = pathlib.Path(scratch, "probe.cc")
        probe.write_text(text)
        words = [*command_of(room), "-E", "-o", "/dev/null", str(probe)]
        return subprocess.run(words, cwd=BUILD, capture_output=True, text=True)


class BuildRefuses(unittest.TestCase):
    def test_a_room_finds_itself_and_the_rooms_in_its_reach_alone(self):
        for room in ROOMS:
            checks = []
            for other in filter(header_of, ROOMS):
                is_found = other == room or other in REACHED[room]
                checks.append(f'#if {"!" if is_found else ""}__has_include("{header_of(other)}")\n'
                              f"#error {other} is {'hidden' if is_found else 'visible'}\n#endif\n")
            with self.subTest(room=room):
                result = preprocess(room, "".join(checks))
                self.assertEqual(result.returncode, 0, result.stderr)

    def test_the_compiler_names_the_include(self):
        lowest, highest = next(iter(ROOMS)), next(reversed(ROOMS))
        upward = header_of(highest)
        refused = preprocess(lowest, f'#include "{upward}"\n')
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn(upward, refused.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
