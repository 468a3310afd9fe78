# Made by build/release/options_markdown --python from src/option_table/rows.cc: change that file.
"""The options of a reconstruction, as keyword arguments of tomofield.reconstruct()."""

import os
from typing import Literal, Optional, Tuple, TypedDict, Union

_Path = Union[str, "os.PathLike[str]"]


class Options(TypedDict, total=False):
    """Everything that a user can choose; docs/options.md lists units, ranges and defaults.

    Options that may be None are chosen from the data or from the other options unless they are
    given. Lengths on the specimen are unbinned pixels of the aligned view; lengths of the field are
    binned pixels.
    """

    # Tilt angles and alignment
    tlt: Optional[_Path]
    xf: Optional[_Path]
    xtilt: Optional[_Path]
    local: Optional[_Path]
    aln: Optional[_Path]
    mdoc: Optional[_Path]
    tilt_offset_deg: float
    x_axis_tilt_deg: float
    tilt_axis_deg: Optional[float]
    exclude: str
    ignore: str

    # Images
    bin: float
    angpix: Optional[float]
    pixel_size_A: Optional[float]
    contrast: Literal["dark", "bright"]
    take_log: bool
    log_base: float
    black_level: Optional[float]

    # Masks
    bead_diameter_nm: Optional[float]
    remove_fixed_pattern: bool
    fiducials: Optional[_Path]
    mask: Optional[_Path]

    # Contrast transfer and dose
    ctf: Optional[_Path]
    defocus_um: Optional[float]
    is_phase_flipped: bool
    defocus_hand: Optional[Literal[1, -1]]
    mtf: Optional[_Path]
    voltage_kV: Optional[float]
    spherical_aberration_mm: Optional[float]
    amplitude_contrast: Optional[float]
    dose_per_tilt: Optional[float]
    is_dose_weighted: bool

    # Specimen
    thickness: float
    roi: Optional[Tuple[int, int, int, int]]
    hand: Literal[1, -1]
    axis_x: Optional[float]
    axis_z: Optional[float]
    shift_z: float
    with_margin: bool

    # Field
    field: Optional[Literal["vm", "grid"]]
    leaf_size: Optional[int]
    tree: Literal["uniform", "adaptive"]
    vertex_spacing: float
    rank: Optional[int]
    budget: str
    tile_rows: Optional[int]

    # Fit
    align: Literal["off", "refine", "full"]
    epochs: Optional[int]
    denoise: str
    density_variation: Optional[float]
    penalty: Optional[Literal["concave", "smooth"]]
    prior: Optional[Literal["tv", "light", "learned"]]
    noise_model: Literal["white", "coloured"]
    fit_view_scale: Optional[bool]
    hold_out: int
    tune: bool
    patience: int
    seed: int

    # Volume
    voxel_type: Literal["float32", "float16", "int16"]
    axes: Literal["xyz", "xzy"]
    invert: bool
    zarr: bool
    zarr_version: Literal["0.4", "0.5"]

    # Halves
    even: Optional[_Path]
    odd: Optional[_Path]
    split_tilts: bool
    denoising_halves: bool

    # Running
    output: _Path
    overwrite: bool
    resume: bool
    checkpoint_minutes: float
    alignment_json: bool

    # For research
    leaf_budget: int
    activation: Optional[Literal["softplus", "identity"]]
    vertex_epochs: Optional[int]
    coarse_epochs: Optional[int]
    coarse_bin: int
    subsets: int
    engine: Literal["slab", "ray"]
    ray_samples: int
    learning_rate: Optional[float]
    factor_variation: float
    boundary: float
    fourier: float
    fourier_ring: Literal["mean", "max"]
    spike_rank: Optional[int]
    fit_noise: bool
    margin_spacing: float
