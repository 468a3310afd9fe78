"""Reconstructions, and what they are made from."""

import contextlib
import html
import os
from dataclasses import dataclass, field
from typing import Any, Dict, Iterator, List, Literal, Mapping, Optional, Tuple, Union, Unpack

import numpy.typing as npt

from . import _core
from ._checks import (Path, array_of, chosen, number_of, places_of, shown, suggestion,
                      switch_of, text_of, whole_number_of)
from ._core import Error
from ._progress import Callback, watched
from ._projects import Project, Setting, open_project
from ._records import Record, record_of
from ._volumes import Model, Tomogram
from .options import Options

Source = Union[Path, Project, npt.ArrayLike]
Watch = Union[Callback, bool, None]
Method = Literal["wbp", "sirt", "sart-tv", "tv", "ingp", "fourier-net"]
MethodOption = Union[str, float, bool]

_going_on: List[int] = []  # of each run the process, which may be one that this one was forked from


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction:
    """What reconstruct(), denoise() or baseline() made.

    is_finished: False if the callback stopped it; the rest is then empty.
    tomogram: the volume, or None if the results went to files.
    model: the field, to be sampled anywhere; None for baselines and halves.
    record: what the command line writes as JSON beside the volume.
    """

    is_finished: bool
    tomogram: Optional[Tomogram]
    model: Optional[Model]
    record: Record
    _inputs: Any = field(default=None)  # choices with what trials chose, and the series

    @property
    def metrics(self) -> Dict[str, Any]:
        """What was measured: metrics["views"], metrics["verdict"]["residual"]."""
        return self.record.metrics

    @property
    def options(self) -> Dict[str, Any]:
        """Every option with the value that was used: options["fit"]["penalty"]."""
        return self.record.options

    @property
    def settings(self) -> List[Setting]:
        """What files of another program set."""
        return self.record.settings

    @property
    def verdict(self) -> str:
        """The line that says how good the fit is."""
        return self.record.verdict

    @property
    def warnings(self) -> List[str]:
        """What seems wrong with the series, and what to do."""
        return self.record.warnings

    def __repr__(self) -> str:
        if not self.is_finished:
            return "<Reconstruction that was stopped>"
        parts = [str(self.tomogram or self.model or "files"), self.verdict]
        return f"<Reconstruction: {'; '.join(part for part in parts if part)}>"

    def _repr_html_(self) -> str:
        shown = self.tomogram or self.model
        texts = [self.verdict, *(f"warning: {text}" for text in self.warnings)]
        if not self.is_finished:
            texts = ["The reconstruction was stopped."]
        picture = shown._repr_html_() if shown is not None else ""
        return picture + "".join(f"<p>{html.escape(text)}</p>" for text in texts if text)


def reconstruct(source: Source, tilt_deg: Optional[npt.ArrayLike] = None, *, series: str = "",
                progress: Watch = None, **options: Unpack[Options]) -> Reconstruction:
    """Reconstruct a tomogram from a tilt series, with the defaults of the command line.

    source: the path of a stack or of a project, a project, or views in memory as an array
        [view, y, x] whose tilt axis runs along y through the image centre.
    tilt_deg: an angle a view, for views in memory, which also need `pixel_size_A`.
    series: the name of one series of a project that has several, for a path.
    progress: a function that is called after every step and returns False to stop; or True for a
        bar (where tqdm is installed), False for none. By default notebooks have a bar.
    options: see tomofield.Options. They go over those of a project. `thickness` is required. With
        `even` and `odd`, the models are files beside the tomogram, so `model` is None. With
        `output`, all results are written as files; without it, nothing is written.

    KeyboardInterrupt stops it too, and so does an exception of `progress`. With `output`, a stopped
    fit leaves a checkpoint for `resume=True`.
    """
    return _run(*_inputs(source, tilt_deg, series, options), progress)


def denoise(made: Reconstruction, strength: Union[str, float], *, output: Path = "",
            overwrite: bool = False, progress: Watch = None) -> Reconstruction:
    """Reconstruct again, less or more smooth, with all else as it was given or chosen.

    made: a finished reconstruction. Its trials are not repeated.
    strength: "light", "medium", "strong", or a factor of the weight, as the option `denoise`.
    output, overwrite, progress: as in reconstruct().
    """
    if not isinstance(made, Reconstruction) or made._inputs is None or not made.is_finished:
        raise Error("only a finished result of reconstruct() can be denoised again")
    choices, core = made._inputs
    settled = choices.copy()
    for name in Options.__annotations__:  # what trials chose is given from now on
        value = getattr(choices, name)
        if value is not None and getattr(_core.Choices(), name) is None:
            setattr(settled, name, value)
    chosen(settled, {"denoise": str(strength), "output": output, "overwrite": overwrite,
                     "resume": False})
    return _run(settled, core, progress)


def baseline(source: Source, method: Method = "wbp", tilt_deg: Optional[npt.ArrayLike] = None, *,
             method_options: Optional[Mapping[str, MethodOption]] = None, series: str = "",
             progress: Watch = None, **options: Unpack[Options]) -> Reconstruction:
    """Reconstruct by another method, to compare with, as `tomofield baseline` does.

    method: weighted back-projection, simultaneous iterative reconstruction, ordered subsets with
        total variation, least squares with total variation, a network with a hash grid, or a
        network of plane waves.
    method_options: what `tomofield baseline METHOD --help` lists under "Method", and ctf_correction:
        {"iterations": 80, "penalty": "concave", "non_negative": False}.
    The other arguments are those of reconstruct(). With `output`, the tomogram, its metrics and its
    pictures are written as files. Options of the field and of its fit raise TypeError.
    """
    methods = _core.BaselineMethod.__members__
    if text_of(method, "method") not in methods:
        raise Error(f"the method is one of {', '.join(map(repr, methods))}, not {method!r}")
    unused = [name for name in options
              if name in Options.__annotations__ and name not in _core.shared_options(method)]
    if unused:
        raise TypeError(f"the method '{method}' does not take {', '.join(unused)}: leave "
                        f"{'it' if len(unused) == 1 else 'them'} out")
    own = _own_options(method, {} if method_options is None else method_options)
    choices, core = _inputs(source, tilt_deg, series, options)
    with _running(progress) as callback:
        made = _core.baseline(core, methods[method], choices, own, callback)
    if not made["is_finished"]:
        return Reconstruction(False, None, None, Record())
    return Reconstruction(True, None if made["tomogram"] is None else Tomogram(*made["tomogram"]),
                          None, record_of(made["metrics"]))


def align(source: Source, tilt_deg: Optional[npt.ArrayLike] = None, *, series: str = "",
          progress: Watch = None, **options: Unpack[Options]) -> bool:
    """Align the views of a tilt series with each other, as `tomofield align` does.

    The arguments are those of reconstruct(); `align` is "refine" unless it is given. The files for
    other programs are written beside `output`, which is not written itself. Returns False if the
    callback stopped it.
    """
    options.setdefault("align", "refine")
    choices, core = _inputs(source, tilt_deg, series, options)
    with _running(progress) as callback:
        return _core.align(core, choices, callback)


def _own_options(method: str, given: Mapping[str, MethodOption]) -> Dict[str, str]:
    """Return the options of a method as the command line takes them, without dashes before them."""
    if not isinstance(given, Mapping):
        raise TypeError("method_options are names with values, as {'iterations': 80}, not "
                        f"{shown(given)}")
    kinds = _core.method_options(method)
    own: Dict[str, str] = {}
    for name, value in given.items():
        flag = text_of(name, "the name of a method's option").replace("_", "-")
        if flag not in kinds:
            nearest = suggestion(_core.nearest_names(flag, list(kinds)))
            raise TypeError(f"the method '{method}' has no option '{name}'{nearest}; it has "
                            f"{', '.join(kinds)}")
        if flag in own:
            raise TypeError(f"method_options have '{flag}' twice, with a dash and with an "
                            "underscore: give it once")
        kind, may_be_open = kinds[flag]
        own[flag] = _text_of(value, name, kind, may_be_open)
    return own


def _text_of(value: object, name: str, kind: str, may_be_open: bool) -> str:
    """Return the value of a method's option as the command line takes it."""
    if may_be_open and isinstance(value, str) and value == "auto":
        return value
    what = f"the option {name}"
    if kind == "a whole number":
        return str(whole_number_of(value, what))
    if kind == "a number":
        return repr(number_of(value, what))
    if kind == "a text":
        return text_of(value, what)
    if isinstance(value, str) and value in ("on", "off"):
        return value
    return "on" if switch_of(value, what) else "off"


@contextlib.contextmanager
def _running(progress: Watch) -> Iterator[Optional[Callback]]:
    """Give the callback of a run while it goes on. A process that was forked meanwhile has its
    locks, but not the threads that would open them."""
    process = os.getpid()
    if any(other != process for other in _going_on):
        raise Error("this process was forked while its parent was reconstructing, and cannot do so "
                    "itself: fork it before, or start it with multiprocessing.get_context('spawn')")
    _going_on.append(process)
    try:
        with watched(progress) as callback:
            yield callback
    finally:
        _going_on.remove(process)


def _run(choices: _core.Choices, core: _core.TiltSeries, progress: Watch) -> Reconstruction:
    with _running(progress) as callback:
        made = _core.reconstruct(core, choices, callback)
    if not made["is_finished"]:
        return Reconstruction(False, None, None, Record())
    return Reconstruction(True, None if made["tomogram"] is None else Tomogram(*made["tomogram"]),
                          None if made["model"] is None else Model._of(made["model"]),
                          record_of(made["metrics"]), (made["choices"], core))


def _inputs(source: Any, tilt_deg: Optional[npt.ArrayLike], series: str,
            given: Mapping[str, object]) -> Tuple[_core.Choices, _core.TiltSeries]:
    if source is None or isinstance(source, (bool, int, float, complex, Mapping)):
        raise TypeError("a series is the path of a stack or of a project, a tomofield.Project, or an "
                        f"array [view, y, x], not {shown(source)}")
    if isinstance(source, (str, bytes, os.PathLike)):
        source = open_project(os.fsdecode(source), series=series,
                              ignore=str(given.get("ignore", "")))
    elif series:
        raise Error("series names one of the series of a project's path: open_project() takes it "
                    "as well")
    if isinstance(source, Project):
        if tilt_deg is not None:
            raise Error("tilt_deg is for views in memory: give the angles of a file with tlt")
        choices = chosen(source._core.copy(), given)
        return choices, _core.TiltSeries.from_files(choices)
    files = [name for name in _core.FILES if given.get(name) is not None]
    if files:
        raise Error(f"{', '.join(files)} cannot be combined with views in memory: give the path of "
                    "an MRC stack")
    if tilt_deg is None:
        raise Error("views in memory need tilt_deg, an angle a view")
    if given.get("pixel_size_A") is None:
        raise Error("views in memory need pixel_size_A, the size of a pixel in Å")
    return (chosen(_core.Choices(), given),
            _core.TiltSeries.from_images(array_of(source), places_of(tilt_deg, "tilt angles")))
