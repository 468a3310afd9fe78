"""Volumes in memory and on disk, models, and boxes of them."""

from dataclasses import dataclass
from typing import Any, Literal, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import _core, _pictures
from ._checks import (Path, array_of, as_array, chosen, count_of, is_masked, number_of, numbers_of,
                      path_of, places_of, shown, switch_of, text_of, whole_number_of)
from ._core import Error

Array = npt.NDArray[np.float32]
Numbers = Tuple[float, float, float]
Axis = Literal["x", "y", "z"]
Level = Union[Literal["found"], Tuple[float, float]]

VOXEL_SIZES_A = (1e-3, 1e7)  # that a file may state, as in src/base/plausible.h


@dataclass(frozen=True, eq=False)
class Tomogram:
    """A volume in memory. numpy takes it for its array: np.mean(tomogram), tomogram[8].

    values: array [z, y, x], float32, in the units and the contrast of the tilt series.
    voxel_size_A: side of a voxel in Å, or 0 if nobody knows it.
    origin_A: x, y, z in Å of its corner in the whole volume, which a file has as ORIGIN.
    """

    values: Array
    voxel_size_A: float
    origin_A: Numbers = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _require_unmasked(self.values)
        values = as_array(self.values)
        if values.ndim != 3:
            raise Error(f"a tomogram has values [z, y, x], and these have {values.ndim} dimensions")
        if values.dtype.kind not in "biuf":
            raise Error(f"a tomogram has real numbers, and these are of type {values.dtype}")
        object.__setattr__(self, "values", values)
        size = number_of(self.voxel_size_A, "voxel_size_A")
        object.__setattr__(self, "voxel_size_A", size if size == 0 else _plausible(size))
        object.__setattr__(self, "origin_A", numbers_of(self.origin_A, 3, number_of, "origin_A"))

    def __array__(self, dtype: Optional[npt.DTypeLike] = None) -> npt.NDArray[Any]:
        return np.asanyarray(self.values, dtype=dtype)  # with the mask that somebody may give it

    def __getitem__(self, key: Any) -> Any:
        return self.values[key]

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        return f"<Tomogram of {self._size()}>"

    @property
    def shape(self) -> Tuple[int, ...]:
        """Numbers of voxels along z, y and x."""
        return self.values.shape

    def section(self, axis: Axis = "z", index: Optional[int] = None) -> Array:
        """Return a section across an axis, by default the one in the middle: [y, x], [z, x] across
        y, [z, y] across x."""
        along = _axis_number(axis)
        at = self.shape[along] // 2 if index is None else whole_number_of(index, "index")
        if not -self.shape[along] <= at < self.shape[along]:
            raise Error(f"there is no section {at} across {axis}: there are {self.shape[along]}")
        values = np.take(self.values, at, axis=along)
        _require_unmasked(values)  # somebody may set a mask later
        return np.asarray(values, np.float32)

    def write(self, path: Path, *, overwrite: bool = False) -> None:
        """Write an MRC file of 32-bit floats."""
        write_mrc(path, self, overwrite=overwrite)

    def _size(self) -> str:
        sides = " × ".join(str(side) for side in reversed(self.shape))
        return f"{sides} voxels (x, y, z) of {self.voxel_size_A:.4g} Å"

    def _repr_html_(self) -> str:
        caption = f"Tomogram of {self._size()}: the middle XY section"
        return _pictures.figure(self.section(), caption)


def _require_unmasked(values: Any) -> None:
    if is_masked(values):
        raise Error("a tomogram has no masked voxels: fill them (numpy.ma.filled)")


@dataclass(frozen=True)
class Box:
    """Cubic voxels anywhere in a model. A tilted plane is a box with one voxel in z.

    centre_px: x, y, z of the box's geometric centre, in pixels of the model: of the aligned, binned
        view at zero tilt, whose pixel i covers [i, i + 1); z runs from 0 to the thickness. An x-axis
        tilt of the views is turned back, as in the volume that reconstruct() writes.
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
        self._core = _core.Model(path_of(path, "a model's file"))

    @classmethod
    def _of(cls, core: _core.Model) -> "Model":
        model = cls.__new__(cls)
        model._core = core
        return model

    def __repr__(self) -> str:
        return f"<Model of {self._size()}>"

    @property
    def pixel_size_A(self) -> float:
        """Size in Å of the pixels that positions count."""
        return self._core.pixel_size_A()

    def region(self, voxel_px: float = 1.0) -> Box:
        """Return the region of interest, in whole voxels of voxel_px pixels."""
        box = self._core.region(number_of(voxel_px, "voxel_px"))
        return _box_of(box)

    def sample(self, box: Box) -> Array:
        """Return the values of a box as an array [z, y, x]."""
        return self._core.sample(_core_box(box))

    def sample_points(self, points: npt.ArrayLike) -> Array:
        """Return the value at each of N points, given as N rows of x, y, z in pixels."""
        return self._core.sample_points(places_of(points, "points"))

    def tomogram(self, voxel_size_A: Optional[float] = None) -> Tomogram:
        """Return the region of interest as a volume, by default with a voxel a pixel."""
        box = self._region_of(voxel_size_A)
        corner = [centre - side * box.voxel_px / 2 for centre, side in zip(box.centre_px, box.size)]
        x, y, z = (at * self.pixel_size_A for at in corner)
        return Tomogram(self.sample(box), box.voxel_px * self.pixel_size_A, (x, y, z))

    def _region_of(self, voxel_size_A: Optional[float]) -> Box:
        return self.region(self._voxel_px(voxel_size_A))

    def _voxel_px(self, voxel_size_A: Optional[float]) -> float:
        """Return the side of voxels in pixels, by default that of a pixel."""
        if voxel_size_A is None:
            return 1.0
        return number_of(voxel_size_A, "voxel_size_A") / self.pixel_size_A

    def _size(self) -> str:
        sides = " × ".join(str(side) for side in self.region().size)
        return f"{sides} pixels (x, y, z) of {self.pixel_size_A:.4g} Å"

    def _repr_html_(self) -> str:
        region = self.region()
        step = max(1.0, max(region.size[:2]) / _pictures.LARGEST)
        width, height = (max(1, int(side / step)) for side in region.size[:2])
        x, y, z = region.centre_px
        middle = z + (0.5 if region.size[2] % 2 == 0 else 0.0)  # as Tomogram.section()
        plane = Box((x, y, middle), (width, height, 1), step, region.euler_deg)
        return _pictures.figure(self.sample(plane)[0],
                                f"Model of {self._size()}: the middle XY section")


def export(model: Union[Model, Path], output: Path, *, box: Union[Box, int, None] = None,
           voxel_size_A: Optional[float] = None, level: Optional[Level] = None,
           particles: Optional[Path] = None, tomogram: str = "",
           voxel_type: Literal["float32", "float16", "int16"] = "float32",
           axes: Literal["xyz", "xzy"] = "xyz", invert: bool = False, zarr: bool = False,
           zarr_version: Literal["0.4", "0.5"] = "0.4", overwrite: bool = False) -> None:
    """Write a box or the particles of a model as an MRC file, as `tomofield export` does.

    model: a model, or the path of its file.
    output: the volume to write, NAME.mrc. Particles are a stack of volumes, and NAME.star is their
        list.
    box: any box; by default the region of interest with voxels of voxel_size_A. With particles, the
        side of the cube of each in voxels.
    voxel_size_A: side of its voxels in Å; by default that of the model's pixels.
    level: turns a specimen that lies aslant back: "found" takes what the alignment before the fit
        found, from NAME_align.json beside the model; (pitch, x_tilt) are degrees. A box then lies
        in the levelled volume.
    particles: a list whose particles are cut out: a STAR file of RELION 5, or the text of
        model2point.
    tomogram: whose particles to take from a list of several tomograms; by default those of the
        model's name.
    voxel_type, axes, invert, zarr, zarr_version, overwrite: as in tomofield.Options.
    """
    if not isinstance(model, Model):
        model = Model(model)
    choices = chosen(_core.Choices(), {"voxel_type": voxel_type, "axes": axes, "invert": invert,
                                       "zarr": zarr, "zarr_version": zarr_version,
                                       "overwrite": overwrite})
    file = path_of(output, "the output")
    angles = _angles(model, level)
    voxel_px = model._voxel_px(voxel_size_A)
    if particles is not None:
        side = count_of(box, "box, the side of the cubes of particles in voxels,")
        _core.export_particles(model._core, path_of(particles, "the list of particles"), side,
                               voxel_px, text_of(tomogram, "tomogram"), angles, file, choices)
        return
    if tomogram:
        raise Error("tomogram names the particles that are taken: give their list with particles")
    if box is not None and not isinstance(box, Box):
        raise TypeError(f"box is a tomofield.Box, not {shown(box)}; a side alone is for particles")
    if box is not None and voxel_size_A is not None:
        raise Error("box states the size of its voxels (voxel_px): leave voxel_size_A out")
    _core.export_box(model._core, None if box is None else _core_box(box), voxel_px, angles, file,
                     choices)


def read_mrc(path: Path) -> Tomogram:
    """Return the values of an MRC file: a volume, or a tilt series as [view, y, x]. The size of a
    voxel is 0 if the file does not state it."""
    return Tomogram(*_core.read_mrc(path_of(path, "a volume's file")))


def write_mrc(path: Path, volume: npt.ArrayLike, voxel_size_A: Optional[float] = None, *,
              overwrite: bool = False) -> None:
    """Write a Tomogram, or an array [z, y, x], as an MRC file of 32-bit floats.

    voxel_size_A: side of a voxel in Å, which an array needs and a Tomogram has.
    """
    size, file = _voxel_size(voxel_size_A, volume), path_of(path, "the output")
    (origin,) = _origins(volume)
    _core.write_mrc(array_of(volume), size, origin, file, switch_of(overwrite, "overwrite"))


def _voxel_size(given: Optional[float], *volumes: Any) -> float:
    """Return the size of a voxel: the one that is given, or that of the first Tomogram."""
    if given is not None:
        return _plausible(number_of(given, "voxel_size_A"))
    for volume in volumes:
        if isinstance(volume, Tomogram):
            return _plausible(volume.voxel_size_A)
    raise Error("an array does not say how large its voxels are: give voxel_size_A, in Å")


def _own_voxel_size(volume: Any) -> float:
    """Return the size of a Tomogram's voxel; 0 for one that does not know it, and for an array."""
    return volume.voxel_size_A if isinstance(volume, Tomogram) else 0.0


def _origins(*volumes: Any) -> Tuple[Numbers, ...]:
    """Return the places of volumes. An array, which states none, lies where a Tomogram does."""
    stated = [volume.origin_A for volume in volumes if isinstance(volume, Tomogram)]
    return tuple(volume.origin_A if isinstance(volume, Tomogram) else [*stated, (0.0, 0.0, 0.0)][0]
                 for volume in volumes)


def _plausible(size_A: float) -> float:
    """Return the size of a voxel if it can be one."""
    low, high = VOXEL_SIZES_A
    if not low <= size_A <= high:
        raise Error(f"a voxel cannot have a side of {size_A} Å: give voxel_size_A, from {low} to "
                    f"{high:.0f} Å")
    return size_A


def _angles(model: Model, level: Optional[Level]) -> Optional[Tuple[float, float]]:
    """Return the angles that bring a specimen level, or None."""
    if level is None:
        return None
    if isinstance(level, str) and level == "found":
        return _core.found_levelling(model._core)
    try:
        return numbers_of(level, 2, number_of, "level")  # type: ignore[no-any-return]
    except TypeError:
        raise TypeError("level is 'found' or two angles in degrees, (pitch, x_tilt), not "
                        f"{shown(level)}") from None


def _axis_number(axis: str) -> int:
    if axis not in ("z", "y", "x"):
        raise Error(f"an axis is one of 'x', 'y', 'z', not {axis!r}")
    return "zyx".index(axis)


def _box_of(core: _core.SampleBox) -> Box:
    (x, y, z), (nx, ny, nz), (rot, tilt, psi) = core.centre_px, core.size, core.euler_deg
    return Box((x, y, z), (nx, ny, nz), core.voxel_px, (rot, tilt, psi))


def _core_box(box: Box) -> _core.SampleBox:
    if not isinstance(box, Box):
        raise TypeError(f"a box is a tomofield.Box, not {shown(box)}")
    try:
        return _core.SampleBox(numbers_of(box.centre_px, 3, number_of, "centre_px"),
                               numbers_of(box.size, 3, count_of, "size"),
                               number_of(box.voxel_px, "voxel_px"),
                               numbers_of(box.euler_deg, 3, number_of, "euler_deg"))
    except TypeError as error:
        raise TypeError("a box has three numbers in centre_px and in euler_deg, three whole numbers "
                        f"in size, and a number in voxel_px: {error}") from None
