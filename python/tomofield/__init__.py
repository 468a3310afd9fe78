"""Continuous density fields from cryo-ET tilt series.

Arrays are [z, y, x] or [view, y, x], float32, with x the fastest axis. Functions raise
tomofield.Error, in one sentence, for files, arrays and options that cannot be used. The results
have the same bits as those of the command line, for any number of threads. Messages go to the
logger "tomofield".
"""

import json
import os
import pathlib
from dataclasses import dataclass
from typing import (Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union,
                    Unpack)

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import Error, Progress, ShellCorrelation, VolumeScores, __version__
from .options import Options

__all__ = ["Box", "Error", "Model", "Options", "Progress", "Project", "Reconstruction", "Setting",
           "ShellCorrelation", "VolumeScores", "__version__", "align", "correlate_shells",
           "open_project", "read_metrics", "reconstruct", "score_volume", "set_thread_count"]

Path = Union[str, "os.PathLike[str]"]
Array = npt.NDArray[np.float32]
Numbers = Tuple[float, float, float]

for _class in (Error, Progress, ShellCorrelation, VolumeScores):
    _class.__module__ = __name__


@dataclass(frozen=True)
class Box:
    """Cubic voxels anywhere in a model. A tilted plane is a box with one voxel in z.

    centre_px: x, y, z of the box's geometric centre, in pixels of the model: of the aligned, binned
        view at zero tilt, whose pixel i covers [i, i + 1); z runs from 0 to the thickness.
    size: voxels in x, y, z.
    voxel_px: side of a voxel in pixels.
    euler_deg: rot, tilt, psi as RELION's rlnAngleRot, rlnAngleTilt and rlnAnglePsi.
    """

    centre_px: Numbers
    size: Tuple[int, int, int]
    voxel_px: float = 1.0
    euler_deg: Numbers = (0.0, 0.0, 0.0)


class Model:
    """A density field that reconstruct() fitted, or that a model file (.h5) holds.

    Values are in the units and the contrast of the tilt series, and 0 outside of the model.
    """

    def __init__(self, path: Path) -> None:
        """Read a model file."""
        self._core = _core.Model(os.fspath(path))

    @classmethod
    def _of(cls, core: Any) -> "Model":
        model = cls.__new__(cls)
        model._core = core
        return model

    @property
    def pixel_size_A(self) -> float:
        """Size in Å of the pixels that positions count."""
        return self._core.pixel_size_A()

    def region(self, voxel_px: float = 1.0) -> Box:
        """Return the region of interest, in whole voxels of voxel_px pixels."""
        box = self._core.region(voxel_px)
        return Box(tuple(box.centre_px), tuple(box.size), box.voxel_px, tuple(box.euler_deg))

    def sample(self, box: Box) -> Array:
        """Return the values of a box as an array [z, y, x]."""
        return self._core.sample(
            _core.SampleBox(box.centre_px, box.size, box.voxel_px, box.euler_deg))

    def sample_points(self, points: npt.ArrayLike) -> Array:
        """Return the value at each of N points, given as N rows of x, y, z in pixels."""
        return self._core.sample_points(points)


@dataclass(frozen=True)
class Reconstruction:
    """What reconstruct() made.

    is_finished: False if the callback stopped it; the rest is then empty.
    tomogram: array [z, y, x], or None if the results went to files.
    model: the field, to be sampled anywhere.
    metrics: what `tomofield reconstruct` writes as JSON beside the volume.
    """

    is_finished: bool
    tomogram: Optional[Array]
    model: Optional[Model]
    metrics: Dict[str, Any]


class Setting(NamedTuple):
    """An option that a file of another program set: "--thickness", "300", tilt.com, "THICKNESS"."""

    option: str
    value: str
    file: pathlib.Path
    entry: str


class Project:
    """A tilt series as eTomo, AreTomo, RELION 5, Warp or SerialEM describe it, from open_project()."""

    def __init__(self, core: Any) -> None:
        object.__setattr__(self, "_core", core)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an option, which goes over what the files say."""
        _chosen(self._core, {name: value})

    @property
    def settings(self) -> List[Setting]:
        """Return what its files set, each with the file and the entry."""
        return [Setting(*setting) for setting in self._core.settings]

    def __getattr__(self, name: str) -> Any:
        """Return the value of an option (tomofield.Options), or None if nobody chose it."""
        if name.startswith("_") or name not in {"stack", *Options.__annotations__}:
            raise AttributeError(f"there is no option '{name}'")
        return getattr(self._core, name)


Series = Union[Path, Project, npt.ArrayLike]
Callback = Callable[[Progress], Optional[bool]]


def open_project(path: Path, *, series: str = "", ignore: str = "") -> Project:
    """Read a project of another program, as the command line does.

    path: its main file or folder. The path of a stack gives the stack alone.
    series: the name of one series of a project that has several.
    ignore: entries of its files that are not applied, as in "LOCALFILE,LOG".
    """
    return Project(_core.open_project(os.fspath(path), series, ignore))


def reconstruct(series: Series, tilt_deg: Optional[Sequence[float]] = None, *,
                progress: Optional[Callback] = None,
                **options: Unpack[Options]) -> Reconstruction:
    """Reconstruct a tomogram from a tilt series, with the defaults of the command line.

    series: the path of a stack or of a project, a project, or views in memory as an array
        [view, y, x] whose tilt axis runs along y through the image centre.
    tilt_deg: an angle a view, for views in memory.
    progress: called after every step; returns False to stop.
    options: see tomofield.Options. They go over those of a project. `thickness` is required. With
        `even` and `odd`, the models are files beside the tomogram, so `model` is None. With
        `output`, all results are written as files; without it, nothing is written.

    KeyboardInterrupt stops it too; with `output`, both leave a checkpoint for `resume=True`.
    """
    choices, core = _inputs(series, tilt_deg, options)
    made = _core.reconstruct(core, choices, progress)
    return Reconstruction(
        made["is_finished"], made["tomogram"],
        None if made["model"] is None else Model._of(made["model"]),
        json.loads(made["metrics"]) if made["is_finished"] else {})


def align(series: Series, tilt_deg: Optional[Sequence[float]] = None, *,
          progress: Optional[Callback] = None, **options: Unpack[Options]) -> bool:
    """Align the views of a tilt series with each other, as `tomofield align` does.

    The arguments are those of reconstruct(); `align` is "refine" unless it is given. The files for
    other programs are written beside `output`, which is not written itself. Returns False if the
    callback stopped it.
    """
    choices, core = _inputs(series, tilt_deg, {"align": "refine", **options})
    return _core.align(core, choices, progress)


def _inputs(series: Any, tilt_deg: Optional[Sequence[float]],
            given: Dict[str, Any]) -> Tuple[Any, Any]:
    if isinstance(series, (str, os.PathLike)):
        series = open_project(series, ignore=given.get("ignore", ""))
    if isinstance(series, Project):
        if tilt_deg is not None:
            raise Error("tilt_deg is for views in memory: give the angles of a file with tlt")
        choices = _chosen(series._core.copy(), given)
        return choices, _core.TiltSeries.from_files(choices)
    files = [name for name in _core.FILES if given.get(name) is not None]
    if files:
        raise Error(f"{', '.join(files)} cannot be combined with views in memory: give the path of "
                    "an MRC stack")
    if tilt_deg is None:
        raise Error("views in memory need tilt_deg, an angle a view")
    return _chosen(_core.Choices(), given), _core.TiltSeries.from_images(series, tilt_deg)


def _chosen(choices: Any, given: Dict[str, Any]) -> Any:
    for name, value in given.items():
        if name not in Options.__annotations__:
            raise TypeError(f"there is no option '{name}'")
        try:
            setattr(choices, name, value)
        except TypeError:
            raise TypeError(f"the option {name} cannot be {value!r}") from None
    return choices


def read_metrics(path: Path) -> Dict[str, Any]:
    """Return the metrics of a reconstruction from its .json file, or the one beside a tomogram."""
    file = pathlib.Path(path).with_suffix(".json")
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise Error(f"cannot read '{file}': {error.strerror}") from None
    except ValueError as error:
        raise Error(f"'{file}' is no JSON: {error}") from None


def score_volume(volume: npt.ArrayLike, truth: npt.ArrayLike) -> VolumeScores:
    """Score a volume against the truth: PSNR and SSIM, raw and after the best scale and offset."""
    return _core.score_volume(volume, truth)


def correlate_shells(first: npt.ArrayLike, second: npt.ArrayLike,
                     voxel_size_A: float = 1.0) -> ShellCorrelation:
    """Return the Fourier shell correlation of two volumes with voxels of this size."""
    return _core.correlate_shells(first, second, voxel_size_A)


def set_thread_count(count: int) -> None:
    """Compute with this many threads. 0, the default: OMP_NUM_THREADS, or else the processors that
    this process may use."""
    _core.set_thread_count(count)
