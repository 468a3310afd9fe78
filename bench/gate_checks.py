"""Compares what a case of bench/gate gives with what is expected, and says every difference in a
sentence. A Result has the dictionaries `settings` and `values`, and `picture`, an array of grey
values [y, x] (gate_cases.py)."""

import collections
import math

import numpy as np

# A value may leave the expected one by `relative` of it or by `absolute`, whichever is more.
#
# A processor with shorter vectors sums in another order. With AVX2 in place of AVX-512 the residual
# and the held-out error of the dust, the film and phantom A differ by less than 0.002 %, the
# speckle by 0.0005 points, the face jump by 0.0002, and the PSNR by 0.000002 dB. The bands are
# wider, since another compiler may change more bits, and as narrow as what the pages of results
# tell apart. The settings and the number of beads are whole choices, which have no band.
Band = collections.namedtuple("Band", "relative absolute unit")
BANDS = {
    "residual": Band(0.01, 0, "of the noise's variance"),
    "held_out_error": Band(0.01, 0, "of the noise's variance"),
    "speckle_percent": Band(0.1, 0.01, "%"),
    "face_jump": Band(0, 0.03, "times that inside leaves"),
    "psnr_dB": Band(0, 0.1, "dB"),
    "beads": Band(0, 0, "beads"),
}
LEAST_CORRELATION = 0.98


def half_width(name, expected):
    """Returns how far a value may lie from the expected one."""
    return max(BANDS[name].relative * abs(expected), BANDS[name].absolute)


def differences(name, expected, found, file):
    """Returns a sentence for each setting, value and slice of a Result that is not as expected.
    `file` has the expected slice."""
    return [f"{name}: {fault}" for fault in
            setting_faults(expected.settings, found.settings)
            + value_faults(expected.values, found.values)
            + picture_faults(file, expected.picture, found.picture)]


def setting_faults(expected, found):
    """Returns a sentence for each expected setting that has another value or none. Settings that
    nobody expected yet are new options, which show in the values if they matter."""
    return [f"the setting {key} is {found.get(key)!r}; expected {value!r}"
            for key, value in sorted(expected.items()) if not is_same(value, found.get(key))]


def is_same(expected, found):
    """Returns true for equal settings. Numbers may differ by rounding."""
    if isinstance(expected, float) and isinstance(found, float):
        return math.isclose(expected, found, rel_tol=1e-6, abs_tol=1e-12)
    return expected == found


def value_faults(expected, found):
    """Returns a sentence for each value that is outside its band, or that only one side has."""
    faults = []
    for key in sorted(expected.keys() | found.keys()):
        if key not in expected or key not in found:
            side = "is missing; expected" if key in expected else "was not expected, but is"
            faults.append(f"{key} {side} {expected.get(key, found.get(key))}")
        elif not abs(found[key] - expected[key]) <= half_width(key, expected[key]):  # also NaN
            faults.append(f"{key} is {found[key]:.4g}; expected {expected[key]:.4g} ± "
                          f"{half_width(key, expected[key]):.2g} {BANDS[key].unit}")
    return faults


def picture_faults(file, expected, found):
    """Returns a sentence if two pictures [y, x] of grey values differ in shape or correlate too
    little."""
    if expected.shape != found.shape:
        return [f"the central slice has {found.shape[1]} x {found.shape[0]} pixels; expected "
                f"{expected.shape[1]} x {expected.shape[0]} as in {file}"]
    correlation = np.corrcoef(expected.ravel(), found.ravel())[0, 1]
    if correlation >= LEAST_CORRELATION:
        return []
    return [f"the central slice correlates by {correlation:.3f} with {file}; expected at least "
            f"{LEAST_CORRELATION}"]
