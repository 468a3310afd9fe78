"""Knows every command, picture and number of README.md, and where it comes from: from a command
that bench/readme runs, or from a page of results."""

import os
import re

PROJECT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
README = os.path.join(PROJECT, "README.md")
PICTURE = "docs/results/exosome_pair.png"
GAP = 8  # pixels between its two slices
# Sentences with numbers that bench/readme makes. The name of a number is its key in the record.
STATEMENTS = (
    r"exosomes: (?P<views>\d+) views of (?P<width>\d+) × (?P<height>\d+) pixels, "
    r"(?P<pixel_size_A>[\d.]+) Å a pixel",
    r"took about (?P<core_seconds>\d+) core-seconds",
    r"\((?P<beads>\d+) gold beads were found",
    r"small file: (?P<compact_MB>[\d.]+) MB, where the tomogram of half floats has "
    r"(?P<half_float_MB>[\d.]+) MB",
)
# Sentences with numbers of a page of results: the page, the sentence, and where the page has the
# numbers. The README may round them.
QUOTES = (
    ("docs/results/speed.md",
     r"series of (?P<views>\d+) views of (?P<side>\d+) × (?P=side) pixels, (?P<depth>\d+) thick",
     r"## (?P<side>\d+)² × (?P<views>\d+) views, (?P<depth>\d+) thick"),
    ("docs/results/speed.md", r"a vertex each (?P<spacing>\d+) pixels",
     r"with a vertex each \*\*(?P<spacing>\d+) pixels\*\*"),
    ("docs/results/speed.md", r"(?P<hours>[\d.]+) core-hours and (?P<memory>[\d.]+) GiB",
     r"\| time \|[^|]* (?P<hours>[\d.]+) core-hours[^#]*?\| memory \| (?P<memory>[\d.]+) GiB"),
    ("docs/results/speed.md",
     r"compact model has (?P<model>\d+) MB, where the tomogram has (?P<volume>\d+) GB",
     r"\| model, checkpoint, [^#]*? (?P<volume>[\d.]+) GB; [^|]* has (?P<model>\d+) MB"),
)
# Numbers in names count no measurement.
NAMES = r"Debian \d+|RELION \d+|NeurIPS \d+|BSD-3-Clause"


def read(path=README):
    with open(path, encoding="utf-8") as file:
        return file.read()


def pattern(sentence):
    """Returns the expression of a sentence that may be broken into lines anywhere."""
    return re.compile(sentence.replace(" ", r"\s+"))


def command(text=None):
    """Returns the arguments of the README's `tomofield reconstruct` for the exosomes."""
    return re.search(r"^tomofield reconstruct (.*exosome.*)$", text or read(), re.M).group(1)


def budget(text=None):
    """Returns the budget of the README's compact model."""
    return re.search(r"tomofield export exo\.h5 --compact small\.h5 --budget (\S+)`",
                     text or read()).group(1)


def with_numbers(text, stated):
    """Returns the text of the README with the numbers {name: text} of its statements."""
    for sentence in STATEMENTS:
        found = pattern(sentence).search(text)
        names = sorted(found.groupdict(), key=found.start, reverse=True)
        for name in names:  # the last one first, so that the places of the others stay
            text = text[:found.start(name)] + stated[name] + text[found.end(name):]
    return text


def faults(text, stated, pictures, read_page=lambda page: read(os.path.join(PROJECT, page))):
    """Returns a sentence for each number and picture of a README's text that is not as recorded,
    that a page of results does not have, or that nobody makes. `stated` is {name: text}, and
    `pictures` are the paths that bench/readme makes."""
    return (statement_faults(text, stated) + quote_faults(text, read_page) + other_numbers(text)
            + other_pictures(text, pictures))


def statement_faults(text, stated):
    found = []
    for sentence in STATEMENTS:
        match = pattern(sentence).search(text)
        if not match:
            found.append(f"no sentence is like '{sentence}', which bench/readme fills")
            continue
        found += [f"{name} is {value}; bench/readme made {stated.get(name)}"
                  for name, value in match.groupdict().items() if value != stated.get(name)]
    return found


def quote_faults(text, read_page):
    found = []
    for page, sentence, source in QUOTES:
        quoted, measured = pattern(sentence).search(text), re.search(source, read_page(page))
        if not quoted or not measured:
            where = "README.md" if not quoted else page
            found.append(f"{where} has nothing like '{sentence if not quoted else source}'")
            continue
        for name, value in quoted.groupdict().items():
            digits = len(value.partition(".")[2])
            if value != f"{float(measured[name]):.{digits}f}":
                found.append(f"{name} is {value}; {page} has {measured[name]}")
    return found


def other_numbers(text):
    """Returns a sentence for each number outside code and links that no list above has."""
    for known in (*STATEMENTS, *(sentence for _, sentence, _ in QUOTES), NAMES):
        text = pattern(known).sub("", text)
    for aside in (r"^```.*?^```", r"`[^`]*`", r"\]\([^)]*\)"):
        text = re.sub(aside, "", text, flags=re.M | re.S)
    return [f"nobody makes the number {number}; list its sentence in bench/readme_page.py, or "
            "leave it to a page of results" for number in re.findall(r"\d+(?:[.,/]\d+)*", text)]


def other_pictures(text, pictures):
    return [f"bench/readme does not make the picture {path}"
            for path in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text) if path not in pictures]
