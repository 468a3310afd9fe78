"""Makes a band of rows of a wide tilt series, and a sparse stack of the size of the whole
series."""

import os
import struct
import subprocess

import quality_rows

HEADER = 1024  # bytes of an MRC header


def band_series(options, wide):
    """Returns the folder of the band of a WideSeries and makes it if it is absent. It holds
    tilt_series.mrc, tilt_series.tlt and the sparse full.mrc."""
    name = f"wide{wide.width}x{wide.thickness}_{wide.rows}_{wide.tilt_step}"
    folder = os.path.join(options.out, "phantoms", name)
    if not os.path.exists(os.path.join(folder, "tilt_series.tlt")):
        make_band_series(options, wide, folder)
    return folder


def make_band_series(options, wide, folder):
    """Simulates the whole series and keeps the band. The whole series takes 2 × width² × views × 4
    bytes of disk until then."""
    whole = folder + ".whole"
    subprocess.run([options.program, "simulate", whole, "--size", str(wide.width), "--thickness",
                    str(wide.thickness), "--extended", f"--tilts=-60:60:{wide.tilt_step}",
                    "--no-truth", "--overwrite"], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    os.makedirs(folder, exist_ok=True)
    series = os.path.join(whole, "tilt_series.mrc")
    cut_band(series, os.path.join(folder, "tilt_series.mrc"), wide.rows)
    write_hollow_copy(series, os.path.join(folder, "full.mrc"))
    os.rename(os.path.join(whole, "tilt_series.tlt"), os.path.join(folder, "tilt_series.tlt"))
    subprocess.run(["rm", "-rf", whole], check=True)


def read_header(file):
    """Returns the header, columns, rows and sections of a stack of floats without an extended
    header, which is what `tomofield simulate` writes."""
    header = bytearray(file.read(HEADER))
    columns, rows, sections, mode = struct.unpack_from("<4i", header)
    (extended,) = struct.unpack_from("<i", header, 92)
    if mode != 2 or extended != 0:
        raise ValueError(f"mode {mode} and {extended} bytes of extended header")
    return header, columns, rows, sections


def cut_band(source, target, num_rows):
    """Writes the middle rows of every section of a stack."""
    with open(source, "rb") as whole, open(target, "wb") as band:
        header, columns, rows, sections = read_header(whole)
        (cell,) = struct.unpack_from("<f", header, 44)
        struct.pack_into("<i", header, 4, num_rows)
        struct.pack_into("<i", header, 32, num_rows)
        struct.pack_into("<f", header, 44, cell * num_rows / rows)
        band.write(header)
        for section in range(sections):
            whole.seek(HEADER + 4 * columns * (section * rows + (rows - num_rows) // 2))
            band.write(whole.read(4 * columns * num_rows))


def write_hollow_copy(source, target):
    """Writes a sparse stack of the same size that holds the first row of each section alone. A dry
    run needs no more: it checks that no section is constant."""
    with open(source, "rb") as whole, open(target, "wb") as hollow:
        header, columns, rows, sections = read_header(whole)
        hollow.write(header)
        for section in range(sections):
            at = HEADER + 4 * columns * rows * section
            whole.seek(at)
            hollow.seek(at)
            hollow.write(whole.read(4 * columns))
        hollow.truncate(HEADER + 4 * columns * rows * sections)


def estimate_of_whole(options, wide, folder):
    """Returns the memory in MiB that a dry run of the whole series predicts."""
    series = quality_rows.series_arguments(folder, wide.thickness)
    series[0] = os.path.join(folder, "full.mrc")
    return quality_rows.dry_run([options.program, "reconstruct", *wide.field.split(),
                                 "--tv-penalty", "concave", *series, "-o",
                                 os.path.join(folder, "dry.mrc")])["MiB"]
