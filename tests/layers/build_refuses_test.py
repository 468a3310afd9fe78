#!/usr/bin/python3
"""Shows that the build refuses an upward include.

  build_refuses_test.py PROJECT_DIR BUILD_DIR

Preprocesses a probe with each layer's own command line, as compile_commands.json has it: it finds
the headers of the layer and of those before it, and none of a later layer.
"""
import json
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest

from check_layers import read_layers

PROJECT, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
SRC = PROJECT / "src"
LAYERS = read_layers(SRC / "layers.txt")


def command_of(layer):
    """Returns the words that compile sources of this layer, without the source and the output."""
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        words = shlex.split(entry["command"])
        if f"-I{BUILD}/layers/{layer}/src" in words:
            return words[:words.index("-o")]
    raise AssertionError(f"no source of {layer} is compiled")


def header_of(layer):
    return str(next((SRC / layer).rglob("*.h")).relative_to(SRC))


def preprocess(layer, text):
    with tempfile.TemporaryDirectory() as scratch:
        probe = pathlib.Path(scratch, "probe.cc")
        probe.write_text(text)
        words = [*command_of(layer), "-E", "-o", "/dev/null", str(probe)]
        return subprocess.run(words, cwd=BUILD, capture_output=True, text=True)


class BuildRefuses(unittest.TestCase):
    def test_a_layer_finds_itself_and_those_before_it_alone(self):
        for rank, layer in enumerate(LAYERS):
            checks = [f'#if {"!" if other <= rank else ""}__has_include("{header_of(name)}")\n'
                      f"#error {name} is {'hidden' if other <= rank else 'visible'}\n#endif\n"
                      for other, name in enumerate(LAYERS)]
            with self.subTest(layer=layer):
                result = preprocess(layer, "".join(checks))
                self.assertEqual(result.returncode, 0, result.stderr)

    def test_the_compiler_names_the_upward_include(self):
        upward = header_of(LAYERS[-1])
        refused = preprocess(LAYERS[0], f'#include "{upward}"\n')
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn(upward, refused.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
