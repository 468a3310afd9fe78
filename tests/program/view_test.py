"""Tests view: the values that it serves, what it refuses, and the page in a browser."""

import contextlib
import http.client
import json
import os
import signal
import socket
import subprocess
import urllib.parse

import numpy as np
import pytest
import skimage.io

import browser
import harness

X, Y, Z = "1,0,0", "0,1,0", "0,0,1"


@pytest.fixture(scope="module")
def results():
    """Returns the results of a small run."""
    return harness.Series("series").reconstruct("run")


class Viewer:
    """Talks to a running `tomofield view`."""

    def __init__(self, run):
        self.run = run
        self.address = run.stdout.readline().strip()
        url = urllib.parse.urlsplit(self.address)
        self.host, self.port, self.path = url.hostname, url.port, url.path

    def request(self, path, method="GET", headers=None):
        """Sends a request and returns its status, headers and body."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=20)
        try:
            connection.request(method, path, headers=headers or {})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def plane(self, width, height, **changes):
        query = {"volume": 0, "center": "24,18,12.5", "right": X, "up": Y, "width": width,
                 "height": height, "step": 1, **changes}
        return self.request(self.path + "plane?" + urllib.parse.urlencode(query))


@contextlib.contextmanager
def viewing(*arguments):
    run = harness.start("view", *arguments)
    try:
        yield Viewer(run)
    finally:
        run.send_signal(signal.SIGINT)
        assert run.wait(timeout=20) == 0, run.stderr.read()


@pytest.fixture(scope="module")
def viewer(results):
    """Returns a viewer of the model beside its volume."""
    with viewing(results.model_path, results.volume_path) as started:
        yield started


def test_it_serves_the_values_of_the_file(viewer, results):
    volume = results.volume
    info = json.loads(viewer.request(viewer.path + "info")[2])["volumes"]
    assert [entry["title"] for entry in info] == ["out.h5", "out.mrc"]
    assert all(entry["size"] == [48, 36, 24] for entry in info)
    assert all(abs(entry["voxel_size_A"] - harness.PIXEL_SIZE) < 1e-4 for entry in info)
    for index in (0, 1):
        status, _, body = viewer.plane(48, 36, volume=index)
        assert status == 200
        np.testing.assert_allclose(np.frombuffer(body, "<f4").reshape(36, 48), volume[12],
                                   atol=2e-3)
        _, _, body = viewer.plane(24, 36, volume=index, center="24.5,18,12", right=Z)
        np.testing.assert_allclose(np.frombuffer(body, "<f4").reshape(36, 24), volume[:, :, 24].T,
                                   atol=2e-3)


def test_a_model_has_more_detail_than_its_voxels(viewer):
    fine = [np.frombuffer(viewer.plane(64, 64, volume=index, step=0.1)[2], "<f4").reshape(64, 64)
            for index in (0, 1)]
    steps = [np.count_nonzero(np.diff(values, axis=1)) for values in fine]
    assert steps[0] > 5 * steps[1], "the field varies within a voxel, the file does not"


def test_it_refuses_what_the_page_does_not_ask(viewer):
    good = viewer.plane(4, 4)
    assert good[0] == 200 and good[1]["X-Content-Type-Options"] == "nosniff"
    for change in ({"width": 4097}, {"width": 0}, {"height": "-1"}, {"step": "nan"}, {"step": 0},
                   {"step": 1e99}, {"center": "1,2"}, {"center": "inf,0,0"}, {"right": "2,0,0"},
                   {"up": X}, {"volume": 2}, {"volume": "/etc/passwd"}, {"volume": "1" * 500}):
        status, _, body = viewer.plane(**{"width": 4, "height": 4, **change})
        assert status == 400 and list(change)[0] in body.decode(), (change, status, body)
    assert viewer.request(viewer.path + "plane")[0] == 400
    for path in ("/", "/info", "/" + "0" * 32 + "/", viewer.path + "../etc/passwd",
                 viewer.path + "%2e%2e/%2e%2e/etc/passwd", viewer.path + "out.h5",
                 viewer.path[:-1], "/etc/passwd"):
        status, _, body = viewer.request(path)
        assert status == 404 and b"root" not in body, (path, status, body)
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH", "HEAD"):
        assert viewer.request(viewer.path, method)[0] == 405, method
    for host in ("evil.example", "evil.example:80", f"evil.example:{viewer.port}",
                 "127.0.0.1", f"127.0.0.1:{viewer.port + 1}", ""):
        assert viewer.request(viewer.path, headers={"Host": host})[0] == 403, host
    assert viewer.request(viewer.path, headers={"Host": f"localhost:{viewer.port}"})[0] == 200
    assert viewer.plane(4, 4) [2] == good[2], "it still answers"


def test_garbage_does_not_end_it(viewer):
    for text in (b"\0" * 1000, b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"GET " + b"a" * 100000,
                 b"POST / HTTP/1.1\r\nContent-Length: 99999999999999\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", viewer.port), timeout=10) as connection:
            with contextlib.suppress(ConnectionError):
                connection.sendall(text)
    assert viewer.plane(4, 4)[0] == 200


def connect(viewer, text):
    """Returns a connection that has sent a text."""
    connection = socket.create_connection(("127.0.0.1", viewer.port), timeout=10)
    connection.sendall(text)
    return connection


def resident_bytes(viewer):
    with open(f"/proc/{viewer.run.pid}/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_head_without_end_takes_no_memory(viewer):
    before = resident_bytes(viewer)
    with contextlib.ExitStack() as stack:
        for _ in range(8):
            connection = stack.enter_context(connect(viewer, b"GET / HTTP/1.1\r\n"))
            with contextlib.suppress(ConnectionError, socket.timeout):
                for number in range(1000):
                    connection.sendall(b"X-%d: " % number + b"a" * 8000 + b"\r\n")
        assert resident_bytes(viewer) - before < 16 << 20, "64 MB were sent"
        assert viewer.plane(4, 4)[0] == 200


def test_neither_slow_nor_idle_connections_keep_the_page_away(viewer):
    starts = (b"", b"G", b"GET / HTTP/1.1\r\nHost: 127.0", b"GET / HTTP/1.1\r\nA: b\r\n\r")
    with contextlib.ExitStack() as stack:
        for number in range(300):
            stack.enter_context(connect(viewer, starts[number % 4]))
        for _ in range(3):
            assert viewer.request(viewer.path)[0] == 200


def test_a_connection_serves_for_several_requests(viewer):
    request = (f"GET {viewer.path} HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n{{}}\r\n")
    both = request.format("") + request.format("Connection: close\r\n")
    with connect(viewer, both.encode()) as connection:
        answer = b"".join(iter(lambda: connection.recv(1 << 16), b""))
    assert answer.count(b"HTTP/1.1 200 OK") == 2 and answer.count(b"</html>") == 2, answer[:400]


def test_head_has_no_body(viewer):
    request = f"HEAD {viewer.path} HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n\r\n"
    with connect(viewer, request.encode()) as connection:
        answer = b"".join(iter(lambda: connection.recv(1 << 16), b""))
    head, _, rest = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 405") and rest == b"", answer[:400]


def test_a_refusal_ends_its_connection(viewer):
    """Else a peer that takes no answers holds a connection as one that is at work."""
    request = f"GET /wrong HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n\r\n".encode()
    with connect(viewer, 400 * request) as connection:
        answer = b""
        with contextlib.suppress(ConnectionError):
            answer = b"".join(iter(lambda: connection.recv(1 << 16), b""))
    assert answer.count(b"HTTP/1.1 404") == 1 and b"Connection: close" in answer, answer


def test_the_work_of_a_request_is_bounded(viewer):
    for volume in (0, 1):
        for right in (X, "0.8,0.6,0"):
            up = Y if right == X else "-0.6,0.8,0"
            status, _, body = viewer.plane(4096, 4096, step=1e9, volume=volume, right=right, up=up)
            values = np.frombuffer(body, "<f4")
            assert status == 200 and values.size == 4096 ** 2
            assert np.count_nonzero(np.isfinite(values)) <= 1, "one pixel is larger than all"


def test_peers_that_take_no_answer_give_its_memory_back(viewer):
    """Four planes of 64 MiB are all that it holds."""
    plane = (f"GET {viewer.path}plane?volume=1&center=24,18,12&right=1,0,0&up=0,1,0&width=4096"
             f"&height=4096&step=1e9 HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n\r\n")
    with contextlib.ExitStack() as stack:
        for _ in range(8):
            stack.enter_context(connect(viewer, plane.encode()))
        assert viewer.plane(4, 4)[0] == 200


def test_ranges_are_not_served(viewer):
    query = urllib.parse.urlencode({"volume": 0, "center": "24,18,12.5", "right": X, "up": Y,
                                    "width": 64, "height": 64, "step": 0.1})
    ranges = "bytes=" + ",".join(["0-"] * 1500)
    status, _, body = viewer.request(viewer.path + "plane?" + query, headers={"Range": ranges})
    assert status == 200 and len(body) == 64 * 64 * 4


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_waits_for_nobody(results, stop):
    """Twenty planes of 16 million pixels would take a minute."""
    run = harness.start("view", results.model_path)
    viewer = Viewer(run)
    plane = (f"GET {viewer.path}plane?volume=0&center=24,18,12&right=1,0,0&up=0,1,0&width=4096"
             f"&height=4096&step=0.003 HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n\r\n")
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            stack.enter_context(connect(viewer, plane.encode()))
        stack.enter_context(connect(viewer, b"GET / HTTP/1.1\r\n"))
        assert viewer.request(viewer.path)[0] == 200, "pages do not wait for planes"
        run.send_signal(stop)
        try:
            assert run.wait(timeout=10) == 0, run.stderr.read()
        finally:
            run.kill()


def test_it_listens_on_loopback_alone(viewer):
    with open("/proc/net/tcp", encoding="ascii") as file:
        lines = [line.split() for line in file][1:]
    listening = [line[1] for line in lines if line[3] == "0A"]
    own = [address for address in listening if int(address.split(":")[1], 16) == viewer.port]
    assert own == [f"0100007F:{viewer.port:04X}"], own


def test_a_port_is_the_one_that_is_asked_for_and_not_shared(results):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with viewing(results.volume_path, "--port", port) as first:
        assert first.port == port
        second = harness.tomofield("view", results.volume_path, "--port", port)
        assert second.returncode == 2 and str(port) in second.stderr, second.stderr


def test_what_cannot_be_shown_is_named(results):
    for arguments, fact in ((["nowhere.mrc"], "nowhere.mrc"), ([results.json_path], "out.json"),
                            ([results.volume_path, "--port", 65536], "65535")):
        result = harness.tomofield("view", *arguments)
        assert result.returncode == 2 and fact in result.stderr, (arguments, result.stderr)
        assert not result.stdout


def test_a_view_whose_address_cannot_be_printed_ends(results):
    with open("/dev/full", "w", encoding="utf-8") as full:
        run = subprocess.run([harness.PROGRAM, "view", results.volume_path], stdout=full, stderr=subprocess.PIPE,
                             text=True, timeout=20, check=False)
    assert run.returncode == 1 and "what was printed cannot be written" in run.stderr, run


@pytest.fixture(scope="module", name="window")
def open_window(viewer, tmp_path_factory):
    """Returns a browser that shows the page of the viewer."""
    window = browser.open_browser(tmp_path_factory.mktemp("profile"))
    window.get(viewer.address)
    browser.wait_until(lambda: window.execute_script(
        "return document.body.dataset.ready") == "yes", "the page is ready")
    settle(window)
    yield window
    window.quit()


def settle(window):
    """Waits until every plane shows what the page wants."""
    browser.wait_until(lambda: window.execute_script("""
        return [...document.querySelectorAll("canvas.plane")].every(
            canvas => canvas.dataset.settled === "yes")"""), "all planes are shown")


def press(window, text):
    window.execute_script("""[...document.querySelectorAll("button")].find(
        button => button.textContent === arguments[0]).click()""", text)


def assert_alike(window, plane):
    """Checks that both volumes show the same. The model is smooth where the file has voxels."""
    pixels = [np.asarray(browser.greys(window, plane, volume)[2], float) for volume in (0, 1)]
    assert np.std(pixels[0]) > 15, "it shows something"
    assert np.corrcoef(pixels)[0, 1] > 0.85, (plane, np.corrcoef(pixels))


def test_two_volumes_are_scrolled_and_zoomed_together(window):
    assert browser.sections(window) == {"x": 25, "y": 19, "z": 13}
    for plane in ("xy", "zy", "xz"):
        assert_alike(window, plane)
    before = browser.greys(window, "xy", 1)
    browser.wheel(window, "xy", 4)
    settle(window)
    assert browser.sections(window)["z"] == 17
    assert browser.greys(window, "xy", 1) != before
    assert_alike(window, "xy")
    browser.wheel(window, "xy", 5, volume=1, ctrlKey=True)
    settle(window)
    for plane in ("xy", "zy", "xz"):
        assert_alike(window, plane)
    picture = os.path.join(harness.SCRATCH, "view.png")
    assert window.save_screenshot(picture) and skimage.io.imread(picture).std() > 20
    press(window, "whole volume")
    settle(window)
    assert browser.sections(window) == {"x": 25, "y": 19, "z": 13}
    assert not browser.complaints(window)


def test_an_oblique_plane_turns(window):
    window.execute_script("document.getElementById('oblique').click()")
    settle(window)
    flat, level = browser.greys(window, "oblique"), browser.greys(window, "xy")
    assert flat[:2] == level[:2]
    inner = np.s_[40:-60, 20:-20]  # without the names
    images = [np.reshape(view[2], (view[1], view[0]))[inner].astype(float) for view in (flat, level)]
    assert np.median(np.abs(images[0] - images[1])) < 6, "with no angle it is the XY plane"
    browser.slide(window, "[data-angle=x]", 90)
    settle(window)
    assert np.mean(np.equal(browser.greys(window, "oblique")[2], 16)) > 0.05, "there are parts outside"
    assert_alike(window, "oblique")
    window.execute_script("document.getElementById('oblique').click()")
    settle(window)
    assert not browser.complaints(window)
