"""The usual deconvolution filter of tomograms for display and as the input of networks, as Warp
defines it (Tegunov and Cramer, Nat. Methods 16, 1146, 2019) and IsoNet takes it over."""

import mrcfile
import numpy as np

VOLTAGE_V, CS_A, AMPLITUDE_CONTRAST = 300e3, 2.7e7, 0.07
STRENGTH, FALLOFF, HIGH_PASS = 1.0, 1.0, 0.02  # the defaults; the last in units of Nyquist's frequency


def transfer(frequency, defocus_A):
    """Returns the contrast transfer at frequencies in cycles per Å, positive at low ones."""
    wavelength = 12.2643 / np.sqrt(VOLTAGE_V + 0.978466e-6 * VOLTAGE_V**2)
    squared = frequency**2
    phase = np.pi * wavelength * squared * (defocus_A - wavelength**2 * squared * CS_A / 2)
    return np.sin(phase + np.arcsin(AMPLITUDE_CONTRAST))


def gain(frequency, voxel_A, defocus_A):
    """Returns Wiener's filter H / (H² + 1 / SNR). The signal-to-noise ratio is assumed to be
    1000 exp(−100 frequency), where the frequency is in units of Nyquist's, over the voxel size, with
    a high-pass at low frequencies."""
    relative = np.clip(frequency * 2 * voxel_A, 0, 1)
    high_pass = 1 - np.cos(np.pi * np.minimum(1, relative / HIGH_PASS))
    snr = 10**(3 * STRENGTH) * np.exp(-100 * FALLOFF * relative / voxel_A) * high_pass
    contrast = transfer(relative / (2 * voxel_A), defocus_A)
    return contrast * snr / (contrast**2 * snr + 1)


def deconvolve(volume, voxel_A, defocus_A):
    """Filters a volume [z, y, x] in which high is dense."""
    axes = [np.fft.fftfreq(n, voxel_A) for n in volume.shape[:2]]
    axes.append(np.fft.rfftfreq(volume.shape[2], voxel_A))
    z, y, x = np.meshgrid(*axes, indexing="ij", sparse=True)
    filtered = np.fft.rfftn(volume) * gain(np.sqrt(x**2 + y**2 + z**2), voxel_A, defocus_A)
    return np.fft.irfftn(filtered, volume.shape)


def deconvolve_file(source, target, defocus_A):
    with mrcfile.open(source) as file:
        volume, voxel = file.data.astype(np.float32), file.voxel_size.copy()
    with mrcfile.new(target, overwrite=True) as file:
        file.set_data(deconvolve(volume, float(voxel.x), defocus_A).astype(np.float32))
        file.voxel_size = voxel
        file.set_volume()
