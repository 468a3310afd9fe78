"""Opens pages in Debian's Chromium for the tests.

The browser is driven by Selenium and chromedriver, which Debian builds from the source of its
Chromium: their versions fit each other on every machine, and nothing is fetched from elsewhere.
Playwright would need npm's registry at test time, and supports the Chromium that it brings itself."""

import os
import shutil
import time

import pytest


def open_browser(folder):
    """Starts a browser that keeps its files in a folder. Skips the test where there is none."""
    selenium = pytest.importorskip("selenium.webdriver", reason="there is no python3-selenium")
    from selenium.webdriver.chrome.service import Service
    for program in ("chromium", "chromedriver"):
        if not shutil.which(program):
            pytest.skip(f"there is no {program}")
    options = selenium.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--disable-gpu", "--window-size=1400,1000",
                     f"--user-data-dir={folder}"):
        options.add_argument(argument)
    if os.geteuid() == 0:
        options.add_argument("--no-sandbox")  # root cannot have one
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = selenium.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    browser.set_script_timeout(20)
    return browser


def wait_until(condition, what, seconds=20):
    """Waits until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.03)


def complaints(browser):
    """Returns what the browser has complained of since the last call."""
    return [entry["message"] for entry in browser.get_log("browser")]


def greys(browser, plane, volume=0):
    """Returns the size of a plane's canvas and the greys of its pixels, rows from the top."""
    width, height, pixels = browser.execute_script("""
        const canvas = document.querySelectorAll(`[data-plane=${arguments[0]}]`)[arguments[1]];
        const copy = document.createElement("canvas");  // which Chromium lets scripts read
        copy.width = canvas.width;
        copy.height = canvas.height;
        const context = copy.getContext("2d", {willReadFrequently: true});
        context.drawImage(canvas, 0, 0);
        const {data, width, height} = context.getImageData(0, 0, copy.width, copy.height);
        return [width, height, [...data.filter((_, i) => i % 4 === 0)]];""", plane, volume)
    return width, height, pixels


def wheel(browser, plane, notches, volume=0, **keys):
    """Turns the wheel over the middle of a plane, away from the user for positive notches."""
    browser.execute_script("""
        const [plane, volume, notches, keys] = arguments;
        const canvas = document.querySelectorAll(`[data-plane=${plane}]`)[volume];
        const {left, top, width, height} = canvas.getBoundingClientRect();
        for (let i = 0; i < Math.abs(notches); ++i)
          canvas.dispatchEvent(new WheelEvent("wheel", {deltaY: -120 * Math.sign(notches),
              clientX: left + width / 2, clientY: top + height / 2, bubbles: true, cancelable: true,
              ...keys}));""", plane, volume, notches, keys)


def slide(browser, selector, value):
    """Moves a slider as the user does."""
    browser.execute_script("""
        const slider = document.querySelector(arguments[0]);
        slider.value = arguments[1];
        slider.dispatchEvent(new Event("input"));""", selector, value)


def sections(browser):
    """Returns the sections that are shown of each axis, as the page says: {"x": 25, …}."""
    return browser.execute_script("""
        return Object.fromEntries([...document.querySelectorAll("input[data-axis]")].map(
            input => [input.dataset.axis, parseInt(input.parentElement.querySelector("output").value)]));""")
