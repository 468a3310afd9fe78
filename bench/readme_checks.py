"""Says where README.md, its picture, and the page of results behind it are not what bench/readme
recorded, or where that record is older than what the program makes."""

import os

from PIL import Image

import exosome_page
import gate_cases
import gate_checks
import gate_files
import readme_page
import start_page


def faults():
    """Returns a sentence for each fault."""
    record = gate_files.read_record()
    if not record:
        return ["README: bench/readme has made no record yet"]
    found = readme_page.faults(readme_page.read(), record["stated"], record["pictures"])
    found += exosome_page.faults(record) + changed_pictures(record)
    found += [f"bench/readme has not made {path} of docs/start.md"
              for path in start_page.pictures() if path not in record["pictures"]]
    return [f"README: {fault}" for fault in found] + age_faults(record)


def changed_pictures(record):
    """Returns a sentence for each picture that is another file than the recorded one."""
    return [f"{path} is another picture than bench/readme made"
            for path, digest in record["pictures"].items()
            if gate_cases.digest(os.path.join(readme_page.PROJECT, path)) != digest]


def age_faults(record):
    """Returns a sentence for each setting, value or picture of the record that is not what the gate
    expects of the README's command now."""
    if not gate_files.has_expected("exosomes"):
        return ["README: there is no expected result of its command yet"]
    expected = gate_files.read_expected("exosomes")
    made = gate_cases.Result(record["settings"], record["values"], right_half())
    return gate_checks.differences("README", expected, made, readme_page.PICTURE)


def right_half():
    """Returns the tomogram's half of the README's picture, as gate_cases.read_slice() gives it."""
    with Image.open(os.path.join(readme_page.PROJECT, readme_page.PICTURE)) as pair:
        half = pair.crop((-(-(pair.width + readme_page.GAP) // 2), 0, pair.width, pair.height))
    return gate_cases.averaged(half)
