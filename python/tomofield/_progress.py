"""A bar that shows how far a reconstruction is, where tqdm is installed."""

import contextlib
import sys
import warnings
from typing import Any, Callable, Iterator, Optional, Union

from ._checks import shown
from ._core import Progress

Callback = Callable[[Progress], Optional[bool]]

STEP = 0.005  # of the whole, between two updates of a bar


@contextlib.contextmanager
def watched(progress: Union[Callback, bool, None]) -> Iterator[Optional[Callback]]:
    """Give the callback of a run: the user's one, one that moves a bar, or none.

    progress: a callback; True for a bar, False for none; None for a bar in notebooks alone.
    """
    if progress is not None and not isinstance(progress, bool):
        if not callable(progress):
            raise TypeError(f"progress is a function, True, False or None, not {shown(progress)}")
        yield progress
        return
    tqdm = _tqdm() if progress or (progress is None and in_notebook()) else None
    if tqdm is None:
        yield None
        return
    with contextlib.closing(_Bars(tqdm)) as bars:
        yield bars.show


def in_notebook() -> bool:
    """Return True in the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def _tqdm() -> Any:
    """Return the class of bars that suits the terminal or the notebook; None without tqdm."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notebooks without ipywidgets have bars of text
        try:
            from tqdm.auto import tqdm  # type: ignore[import]
        except ImportError:
            return None
    return tqdm


class _Bars:
    """A bar for the trials that choose settings, and one for the fit."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm, self._bar = tqdm, None
        self._is_trial: Optional[bool] = None
        self._shown = 0.0

    def show(self, progress: Progress) -> None:
        if progress.is_trial != self._is_trial:
            self.close()
            self._is_trial, self._shown = progress.is_trial, 0.0
            self._bar = self._tqdm(total=100, unit=" %", desc="trials" if self._is_trial else "fit",
                                   bar_format="{desc} |{bar}| {n:.0f} % {elapsed}<{remaining}")
        done = progress.fraction_done
        if self._bar is not None and (done - self._shown >= STEP or done == 1):
            self._bar.n, self._shown = 100 * done, done
            self._bar.refresh()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
