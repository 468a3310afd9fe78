"""Continuous density fields from cryo-ET tilt series.

Arrays are [z, y, x] or [view, y, x], float32, with x the fastest axis. Functions raise
tomofield.Error, in one sentence, for files, arrays and options that cannot be used. The results
have the same bits as those of the command line, for any number of threads. Messages go to the
logger "tomofield".
"""

from dataclasses import dataclass
from typing import List, Optional

import numpy.typing as npt

from . import _core
from ._checks import array_of, count_of, number_of
from ._core import Error, Progress, VolumeScores, __version__
from ._projects import Project, Setting, open_project
from ._records import Record, read_metrics, read_record
from ._runs import Reconstruction, align, baseline, denoise, reconstruct
from ._volumes import (Box, Model, Tomogram, _origins, _own_voxel_size, _voxel_size, export, read_mrc,
                       write_mrc)
from .options import Options

__all__ = ["Box", "Error", "Model", "Options", "Progress", "Project", "Reconstruction", "Record",
           "Setting", "ShellCorrelation", "Tomogram", "VolumeScores", "__version__", "align",
           "baseline", "correlate_shells", "denoise", "export", "open_project", "read_metrics",
           "read_mrc", "read_record", "reconstruct", "score_volume", "set_thread_count",
           "write_mrc"]


@dataclass(frozen=True, eq=False, repr=False)
class ShellCorrelation:
    """Fourier shell correlation, by shell."""

    frequency_per_A: List[float]
    correlation: List[float]
    voxels: List[int]
    _core: _core.ShellCorrelation

    def resolution_A(self, threshold: float = 0.143) -> Optional[float]:
        """Return where the correlation first falls below a threshold, in Å, or None."""
        level = number_of(threshold, "the threshold")
        if not -1 <= level <= 1:
            raise Error(f"the threshold is a correlation from -1 to 1, not {level}")
        return self._core.resolution_A(level)


def score_volume(volume: npt.ArrayLike, truth: npt.ArrayLike) -> VolumeScores:
    """Score a volume against the truth: PSNR and SSIM, raw and after the best scale and offset."""
    return _core.score_volume(array_of(volume), array_of(truth), _own_voxel_size(volume),
                              _own_voxel_size(truth), _origins(volume, truth))


def correlate_shells(first: npt.ArrayLike, second: npt.ArrayLike,
                     voxel_size_A: Optional[float] = None) -> ShellCorrelation:
    """Return the Fourier shell correlation of two volumes.

    voxel_size_A: side of a voxel in Å, which arrays need and a Tomogram has.
    """
    size = _voxel_size(voxel_size_A, first, second)
    sizes = [size if voxel_size_A is not None else _own_voxel_size(volume) or size
             for volume in (first, second)]
    curve = _core.correlate_shells(array_of(first), array_of(second), sizes[0], sizes[1],
                                   _origins(first, second))
    return ShellCorrelation(curve.frequency_per_A, curve.correlation, curve.voxels, curve)


def set_thread_count(count: int) -> None:
    """Compute with this many threads. 0, the default: OMP_NUM_THREADS, or else the processors that
    this process may use. Raise Error while another thread or the caller of a callback computes."""
    _core.set_thread_count(count_of(count, "the number of threads"))


for _name in __all__:  # messages and help call them by the names that users know
    if hasattr(globals()[_name], "__module__"):
        globals()[_name].__module__ = __name__
