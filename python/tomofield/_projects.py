"""Projects of other programs."""

import html
import pathlib
from typing import Any, List, NamedTuple

from . import _core
from ._checks import Path, chosen, no_option, path_of, said, text_of
from .options import Options


class Setting(NamedTuple):
    """An option that a file sets: "--thickness", "300", tilt.com, "THICKNESS".

    row: the name of its row, if the file lists several series.
    instead: what holds in its place, as "--thickness 200"; empty if it holds itself.
    """

    option: str
    value: str
    file: pathlib.Path
    entry: str
    row: str = ""
    instead: str = ""


class Project:
    """A tilt series as eTomo, AreTomo, RELION 5, Warp or SerialEM describe it, from open_project().

    Its attributes are the options of tomofield.Options, and `stack`. Set one, and it goes over what
    the files say.
    """

    def __init__(self, core: _core.Choices, warnings: List[str]) -> None:
        object.__setattr__(self, "_core", core)
        object.__setattr__(self, "_warnings", tuple(warnings))

    def __setattr__(self, name: str, value: Any) -> None:
        chosen(self._core, {name: value})

    @property
    def settings(self) -> List[Setting]:
        """Return what its files set, each with the file and the entry."""
        return [Setting(*setting) for setting in self._core.settings]

    @property
    def warnings(self) -> List[str]:
        """Return what its files say that the result will not show by itself."""
        return list(self._warnings)

    def __getattr__(self, name: str) -> Any:
        """Return the value of an option, or None if nobody chose it."""
        if name.startswith("_") or name not in {"stack", *Options.__annotations__}:
            raise AttributeError(no_option(name))
        return getattr(self._core, name)

    def __repr__(self) -> str:
        return f"<Project of {said(self.stack)} with {len(self.settings)} settings>"

    def _repr_html_(self) -> str:
        rows = [("option", "value", "file", "entry")]
        rows += [(s.option, s.value, str(s.file), s.entry) for s in self.settings]
        lines = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
        table = "".join(f"<tr>{line}</tr>" for line in lines)
        notes = "".join(f"<p>{html.escape(warning)}</p>" for warning in self.warnings)
        return f"<table>{table}</table>{notes}"


def open_project(path: Path, *, series: str = "", ignore: str = "") -> Project:
    """Read a project of another program, as the command line does.

    path: its main file or folder. The path of a stack gives the stack alone.
    series: the name of one series of a project that has several.
    ignore: entries of its files that are not applied, as in "LOCALFILE,LOG".
    """
    return Project(*_core.open_project(path_of(path, "the project"), text_of(series, "series"),
                                       text_of(ignore, "ignore")))
