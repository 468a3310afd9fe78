"""Tests the report of reconstruct: what it says, that it needs nothing else, and that a browser
shows the volume in it."""

import json
import os
import re

import numpy as np
import pytest
import skimage.io

import browser
import harness


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module")
def results(series):
    """Returns the results of a run with held-out views."""
    return series.reconstruct("run", "--hold-out", 5, "--view-scale", "on")


@pytest.fixture(scope="module")
def page(results):
    with open(results.report_path, encoding="utf-8") as file:
        return file.read()


@pytest.fixture(scope="module", name="chromium")
def open_page(results, tmp_path_factory):
    """Returns a browser that shows the report."""
    window = browser.open_browser(tmp_path_factory.mktemp("profile"))
    window.get("file://" + results.report_path)
    browser.wait_until(lambda: window.execute_script(
        "return document.getElementById('volume').dataset.ready") == "yes", "the volume is shown")
    yield window
    window.quit()


@pytest.fixture
def shown(chromium):
    """Returns the browser with the view as it is at first."""
    for text in ("whole volume", "reset contrast"):
        chromium.execute_script("""[...document.querySelectorAll("button")].find(
            button => button.textContent === arguments[0]).click()""", text)
    return chromium


def test_it_says_what_went_in_and_what_came_out(results, page):
    with open(results.json_path) as file:
        metrics = json.load(file)["metrics"]
    text = re.sub(r"<[^>]*>", " ", re.sub(r"<script.*?</script>|<style.*?</style>", "", page,
                                          flags=re.S))
    text = " ".join(text.split())
    for fact in ("48 × 36 × 24", "13.37 Å", f"{metrics['verdict']['residual']:.2f}",
                 f"{metrics['verdict']['held_out']['median']:.2f}",
                 "--thickness 24 unbinned pixels given", "--contrast bright given",
                 "--field vm given", "Tilts from -60.0° to 60.0°", "options have their defaults",
                 "--seed 1 default"):
        assert fact in text, fact
    for warning in metrics["verdict"]["warnings"]:
        assert warning["message"][1:60] in text, warning
    headings = re.findall("<h2>([^<]*)</h2>", page)
    assert headings == ["The tomogram", "What went in, and what was assumed", "Masks",
                        "Lighter or stronger denoising", "Loss",
                        "Views: residual", "Views: scale and weight", "Views: offset and noise",
                        "Views: alignment", "Histogram", "Time and memory"], headings
    assert "CTF and dose" not in text, "a bright series has none"


def test_every_fitted_view_has_a_residual(results):
    with open(results.json_path) as file:
        metrics = json.load(file)["metrics"]
    held_out = {view["view"] for view in metrics["held_out"]["views"]}
    residuals = [view["residual"] for view in metrics["views"]]
    assert {i for i, residual in enumerate(residuals) if residual is None} == held_out
    mean = np.mean([residual for residual in residuals if residual is not None])
    assert abs(mean - metrics["verdict"]["residual"]) < 0.05 * mean, residuals


def test_it_needs_no_other_file_and_no_network(page):
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "default-src 'none'" in page
    urls = set(re.findall(r"https?://[^\"' )]*", page))
    assert urls == {"http://www.w3.org/2000/svg"}, urls  # a name, not an address


def test_a_dark_series_has_a_word_on_ctf_and_dose_and_its_trials(series):
    dark = series.with_views("dark", 30 - series.views)
    folder = harness.fresh_directory("dark_run")
    harness.succeed("reconstruct", *dark.input, "--thickness", 24, "--no-margin", "--contrast",
                    "dark", "--epochs", 1, "--coarse-epochs", 4, "--tree", "adaptive", "--leaf-size",
                    16, "-o", os.path.join(folder, "out.mrc"))
    with open(os.path.join(folder, "out_report.html"), encoding="utf-8") as file:
        page = file.read()
    assert "CTF and dose" in page and "chosen by trials" in page
    for heading in ("Settings that trials chose", "Lighter or stronger denoising", "Tree"):
        assert f"<h2>{heading}</h2>" in page, heading
    assert page.count("data:image/png") == 3, "masks, tree and the sections of three trials"


def test_an_existing_report_is_kept(series):
    folder = harness.fresh_directory("kept_run")
    report = os.path.join(folder, "out_report.html")
    with open(report, "w") as file:
        file.write("years of work")
    result = harness.tomofield("reconstruct", *series.input, *harness.QUICK, "-o",
                               os.path.join(folder, "out.mrc"))
    assert result.returncode == 2 and report in result.stderr, result.stderr
    assert os.listdir(folder) == ["out_report.html"]


def expected_plane(volume, plane, position):
    """Returns a plane of a volume [z, y, x] as the page draws it, rows from the top."""
    x, y, z = position
    return {"xy": volume[z], "zy": volume[:, :, x].T, "xz": volume[:, y]}[plane][::-1]


def assert_shows(window, volume, plane, position, contrast, tolerance=12):
    """Checks the greys in the middle of some voxels against the file."""
    expected = expected_plane(volume, plane, position)
    black, white = contrast
    expected = np.clip(255 * (expected - black) / (white - black), 0, 255)
    width, height, pixels = browser.greys(window, plane)
    pixels = np.reshape(pixels, (height, width))
    rows = ((np.arange(expected.shape[0]) + 0.3) * height / expected.shape[0]).astype(int)
    columns = ((np.arange(expected.shape[1]) + 0.3) * width / expected.shape[1]).astype(int)
    found = pixels[np.ix_(rows, columns)].astype(float)
    cut = np.s_[3:-3, 3:-3]  # without the plane's name and the scale bar, as far as possible
    error = np.median(np.abs(found - expected)[cut])
    assert error < tolerance, (plane, position, error)


def first_contrast(volume):
    """Returns black and white of the middle: half of the shortest axis, three quarters of others."""
    middle = volume
    for axis, size in enumerate(volume.shape):
        count = size // 2 if size == min(volume.shape) else 3 * size // 4
        middle = np.take(middle, np.arange((size - count) // 2, (size - count) // 2 + count), axis)
    black, low, median, high, white = np.percentile(middle, [0.5, 2, 50, 98, 99.5])
    return max(black, median + 3 * (low - median)), min(white, median + 3 * (high - median))


def test_a_browser_shows_all_three_planes_of_the_file(shown, results):
    volume = results.volume
    assert browser.sections(shown) == {"x": 25, "y": 19, "z": 13}
    for plane in ("xy", "zy", "xz"):
        assert_shows(shown, volume, plane, (24, 18, 12), first_contrast(volume))
    sizes = {plane: browser.greys(shown, plane)[:2] for plane in ("xy", "zy", "xz")}
    assert abs(sizes["xy"][0] / sizes["xy"][1] - 48 / 36) < 0.02, sizes
    assert abs(sizes["zy"][0] / sizes["zy"][1] - 24 / 36) < 0.02, sizes
    assert sizes["xy"][1] == sizes["zy"][1] and sizes["xy"][0] == sizes["xz"][0], sizes
    assert not browser.complaints(shown)
    assert shown.execute_script(
        "return [...document.images].every(i => i.complete && i.naturalWidth > 0)")
    picture = os.path.join(harness.SCRATCH, "report.png")
    assert shown.save_screenshot(picture) and skimage.io.imread(picture).std() > 20


def test_wheel_keys_and_sliders_scroll(shown, results):
    from selenium.webdriver.common.keys import Keys
    volume = results.volume
    browser.wheel(shown, "xy", 3)
    assert browser.sections(shown) == {"x": 25, "y": 19, "z": 16}
    browser.wheel(shown, "zy", -2)
    assert browser.sections(shown) == {"x": 23, "y": 19, "z": 16}
    browser.slide(shown, "[data-axis=y]", 5)
    assert browser.sections(shown) == {"x": 23, "y": 6, "z": 16}
    plane = shown.find_element("css selector", "[data-plane=xz]")
    plane.send_keys(Keys.ARROW_UP, Keys.ARROW_UP, Keys.PAGE_UP)
    assert browser.sections(shown) == {"x": 23, "y": 18, "z": 16}
    for name in ("xy", "zy", "xz"):
        assert_shows(shown, volume, name, (22, 17, 15), first_contrast(volume))
    browser.wheel(shown, "xy", 100)
    assert browser.sections(shown)["z"] == 24, "the last section"


def test_a_click_moves_the_other_planes_and_a_drag_pans(shown):
    from selenium.webdriver import ActionChains
    plane = shown.find_element("css selector", "[data-plane=xy]")
    shown.execute_script("arguments[0].scrollIntoView()", plane)  # all of it
    size = plane.size
    # Offsets count from the middle: a quarter to the right, a third up.
    ActionChains(shown).move_to_element_with_offset(plane, size["width"] // 4, -size["height"] // 3
                                                    ).click().perform()
    at = browser.sections(shown)
    assert at == {"x": 37, "y": 31, "z": 13} or abs(at["x"] - 37) + abs(at["y"] - 31) <= 1, at
    ActionChains(shown).move_to_element_with_offset(plane, 5, 5).perform()
    status = shown.find_element("css selector", ".status").text
    assert re.match(r"voxel 25, 18, 13: -?[\d.]+", status), status
    browser.wheel(shown, "xy", 4, ctrlKey=True)
    before = browser.greys(shown, "xy")
    ActionChains(shown).move_to_element(plane).click_and_hold().move_by_offset(60, 40).release(
    ).perform()
    assert browser.sections(shown) == at, "a drag is no click"
    assert browser.greys(shown, "xy") != before


def test_contrast_follows_its_sliders(shown, results):
    low, high = first_contrast(results.volume)
    middle = 0.5 * (low + high)
    for label, value in (("black", low), ("white", middle)):
        browser.slide(shown, f"[aria-label={label}]", value)
    assert_shows(shown, results.volume, "xy", (24, 18, 12), (low, middle), tolerance=20)
