"""Knows the commands and pictures of docs/start.md: runs its commands in folders that
bench/start_folders.py makes, and takes the pictures from what they write."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile

import readme_page
import start_folders

PAGE = os.path.join(readme_page.PROJECT, "docs", "start.md")
REPORT = "etomo_report.html"
SIZE = 128  # pixels of a view, for the pictures


def commands(text=None):
    """Returns the words of every `tomofield …` in the blocks of the page."""
    text = readme_page.read(PAGE) if text is None else text
    blocks = re.findall(r"^```sh\n(.*?)^```$", text, re.M | re.S)
    return [shlex.split(line)[1:] for block in blocks for line in block.splitlines()
            if line.startswith("tomofield ")]


def pictures(text=None):
    """Returns {picture of the page: the file that a command writes}, by the name of its results: its
    section, or the report whose beginning start_report.png shows."""
    text = readme_page.read(PAGE) if text is None else text
    return {f"docs/{path}": REPORT if name == "report" else f"{name}_xy.png"
            for path, name in re.findall(r"\]\((results/start_(\w+)\.png)\)", text)}


def photograph(page, picture):
    """Draws the beginning of a report as Chromium shows it, once its planes are unpacked."""
    sys.path.append(os.path.join(readme_page.PROJECT, "tests", "program"))
    import browser
    with tempfile.TemporaryDirectory() as profile:
        window = browser.open_browser(profile)
        try:
            window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                   {"width": 1000, "height": 1250, "deviceScaleFactor": 1,
                                    "mobile": False})
            window.get(f"file://{os.path.abspath(page)}")
            browser.wait_until(lambda: window.execute_script(
                "return document.getElementById('volume').dataset.ready") == "yes",
                               "the planes are shown")
            window.save_screenshot(picture)
        finally:
            window.quit()


def make(program, folder):
    """Runs all commands, and copies their pictures into docs/. Returns the paths of these."""
    start_folders.make_folders(program, folder, SIZE)
    for words in commands():
        more = ["--overwrite"] if "-o" in words else []
        subprocess.run([os.path.abspath(program), *words, *more], cwd=folder, check=True)
    for picture, made in pictures().items():
        draw = photograph if made == REPORT else shutil.copy
        draw(os.path.join(folder, made), os.path.join(readme_page.PROJECT, picture))
    return list(pictures())
