"""Reads and writes the committed files of bench/gate in bench/gate_expected: NAME.json and NAME.png
of each case, and readme.json, the record of what bench/readme made."""

import json
import os

from PIL import Image

import gate_cases

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "gate_expected")
RECORD = os.path.join(FOLDER, "readme.json")


def paths(name):
    """Returns the paths of the two files of a case."""
    return [os.path.join(FOLDER, name + end) for end in (".json", ".png")]


def has_expected(name):
    return all(map(os.path.exists, paths(name)))


def read_expected(name):
    """Returns the Result that a case is expected to give."""
    record, picture = paths(name)
    return gate_cases.Result(**gate_cases.read_json(record),
                             picture=gate_cases.read_slice(picture))


def write_expected(name, result):
    """Makes the Result of a case the expected one."""
    os.makedirs(FOLDER, exist_ok=True)
    record, picture = paths(name)
    write_json(record, {"settings": result.settings, "values": result.values})
    Image.fromarray(result.picture).save(picture, optimize=True)


def write_json(path, content):
    with open(path, "w", encoding="utf-8") as file:
        json.dump(content, file, indent=1, ensure_ascii=False, sort_keys=True)
        file.write("\n")


def read_record():
    """Returns the record of bench/readme, which is empty before its first run."""
    return gate_cases.read_json(RECORD) if os.path.exists(RECORD) else {}
