"""Bars of progress: in notebooks by default, elsewhere if they are wanted, nowhere without tqdm."""

import builtins
import io
import re
import sys
import types

import pytest

from tomofield import _progress


def report(fraction, is_trial=False):
    return types.SimpleNamespace(fraction_done=fraction, is_trial=is_trial)


@pytest.fixture
def notebook(monkeypatch):
    """Pretends to be the kernel of a notebook."""
    shell = type("ZMQInteractiveShell", (), {})()
    monkeypatch.setitem(sys.modules, "IPython",
                        types.SimpleNamespace(get_ipython=lambda: shell))


def test_scripts_have_no_bar_unless_they_want_one():
    assert not _progress.in_notebook()
    with _progress.watched(None) as callback:
        assert callback is None
    with _progress.watched(False) as callback:
        assert callback is None


def test_a_callback_is_passed_on(notebook):
    def own(progress):
        return False
    with _progress.watched(own) as callback:
        assert callback is own


def test_a_bar_shows_trials_and_the_fit(capsys):
    with _progress.watched(True) as callback:
        for fraction in (0.5, 1.0):
            assert callback(report(fraction, is_trial=True)) is None
        for fraction in (0.001, 0.25, 1.0):
            callback(report(fraction))
    shown = re.split(r"[\r\n]", capsys.readouterr().err)
    for name in ("trials", "fit"):
        last = [line for line in shown if line.startswith(name)][-1]
        assert "| 100 % " in last, shown


def test_notebooks_have_a_bar_by_default(notebook, monkeypatch):
    tqdm = pytest.importorskip("tqdm")
    monkeypatch.setattr(_progress, "_tqdm", lambda: tqdm.tqdm)
    assert _progress.in_notebook()
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with _progress.watched(None) as callback:
        callback(report(1.0))
    assert "fit |" in sys.stderr.getvalue()
    with _progress.watched(False) as callback:
        assert callback is None


def test_without_tqdm_there_is_nothing(notebook, monkeypatch):
    real = builtins.__import__

    def without_tqdm(name, *rest, **keywords):
        if name.startswith("tqdm"):
            raise ImportError(name)
        return real(name, *rest, **keywords)
    monkeypatch.setattr(builtins, "__import__", without_tqdm)
    with _progress.watched(True) as callback:
        assert callback is None
