"""Hands the Python layer arrays of every type, layout and size, good and bad, from seeds.

    python3 tests/python/array_cases.py FIRST LAST MODEL.h5 [FOLDER_OF_THE_MODULE]

tries the seeds from FIRST to LAST and prints how many calls had an answer and how many were
refused. module_arrays_test.py tries some."""

import sys

import numpy as np

DTYPES = ["f4", "f8", "f2", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?", ">f4", ">f8", ">i2",
          ">u8", "c8", "U3", "S3", "M8[s]", "m8[s]", "O", "V4", "g"]
REAL = set("biuf")
PLACES = "f8"  # the type of angles and points, which are finite
SPECIAL = [np.nan, np.inf, -np.inf, 1e38, -1e38, 1e300, 1e-42, 0.0, -0.0, 1e15, 2.0**63]


class Cases:
    """Draws arrays from a seed."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)

    def one_of(self, values):
        return values[self.random.integers(len(values))]

    def chance(self, part):
        return self.random.random() < part

    def shape(self, wanted):
        """Returns mostly a shape that is wanted, else one with other sizes or dimensions."""
        if self.chance(0.7):
            return tuple(wanted)
        shape = [int(self.one_of([0, 1, 2, n, n + 1])) for n in wanted]
        if self.chance(0.3):
            shape = shape[: self.random.integers(len(shape) + 1)]
        return tuple(shape + [2] * int(self.chance(0.1)))

    def values(self, shape, dtype):
        values = np.array(self.random.normal(size=shape, scale=self.one_of([1, 1, 50, 1e4])))
        if self.chance(0.3) and values.size:
            flat = values.reshape(-1)
            for _ in range(self.random.integers(1, 4)):
                flat[self.random.integers(flat.size)] = self.one_of(SPECIAL)
        if self.chance(0.1):
            values = np.full(shape, self.one_of(SPECIAL))
        with np.errstate(all="ignore"):
            if np.dtype(dtype).kind in "MmV":
                return np.zeros(shape, dtype)
            if np.dtype(dtype).kind in "iu":
                values = np.nan_to_num(values, nan=0, posinf=100, neginf=-100).clip(-100, 100)
            return np.asarray(values).astype(dtype)

    def laid_out(self, array):
        """Returns the same values with other strides, or as another kind of object."""
        kind = self.random.integers(9)
        if kind == 0:
            return np.asfortranarray(array)
        if kind == 1 and array.ndim:
            wide = np.repeat(array, 2, axis=-1)
            return wide[..., ::2]
        if kind == 2 and array.ndim:
            return np.ascontiguousarray(array[::-1])[::-1]
        if kind == 3:
            array = np.array(array)
            array.flags.writeable = False
        if kind == 4:
            return array.tolist()
        if kind == 5 and array.ndim:
            return array.view(np.ma.MaskedArray)
        if kind == 6 and array.ndim and array.size:
            return np.broadcast_to(array[:1], array.shape)
        if kind == 7 and array.dtype.kind in REAL and array.dtype.isnative:
            raw = np.zeros(array.nbytes + 1, np.uint8)[1:]  # not aligned
            raw = raw.view(array.dtype).reshape(array.shape)
            raw[...] = array
            return raw
        return array

    def array(self, *wanted, dtype=None):
        if dtype is None:
            dtype = self.one_of(DTYPES) if self.chance(0.6) else "f4"
        return self.laid_out(self.values(self.shape(wanted), dtype))


def plain(array, dtype):
    """Returns a contiguous copy of an array in the machine's numbers, as the library has them."""
    with np.errstate(all="ignore"):
        return np.array(np.asarray(array), dtype, order="C")


def answer(call, *arguments, overflow="ignore"):
    """Returns what a call returns, or None if it is refused in a sentence. Nothing else may leave it."""
    import tomofield
    try:
        with np.errstate(over=overflow):
            return call(*arguments)
    except tomofield.Error as error:
        sentence = str(error)
        assert len(sentence) > 10 and "internal" not in sentence, sentence
        return None


def same(one, other):
    if one is None or other is None:
        return one is other
    return np.array_equal(np.asarray(one), np.asarray(other), equal_nan=True)


def check(call, arrays, dtypes, overflow):
    """Calls with arrays while NumPy ignores or raises overflow, checks that they stay as they are, and that copies of another layout and
    type have the same answer. Returns whether there was an answer."""
    before = [np.array(np.asarray(array), copy=True) for array in arrays]
    found = answer(call, *arrays, overflow=overflow)
    for array, was in zip(arrays, before):
        assert np.asarray(array).tobytes() == was.tobytes(), "an input was changed"
    if found is not None:
        for array, dtype in zip(arrays, dtypes):
            assert np.asarray(array).dtype.kind in REAL, "what is no real number was cast"
            if dtype == PLACES:
                assert np.isfinite(plain(array, dtype)).all(), "no place is infinite"
        copies = [plain(array, dtype) for array, dtype in zip(arrays, dtypes)]
        assert same(found, answer(call, *copies)), "the layout matters"
    return found is not None


def scores(volume, truth):
    import tomofield
    scored = tomofield.score_volume(volume, truth)
    return [scored.psnr_raw_dB, scored.psnr_affine_dB, scored.ssim_raw, scored.correlation]


def shells(first, second):
    import tomofield
    return tomofield.correlate_shells(first, second, 2.0).correlation


def first_step(views, tilts):
    """Reconstructs until the first step is done."""
    import tomofield
    made = tomofield.reconstruct(
        views, tilts, thickness=8, contrast="bright", with_margin=False, leaf_size=16, rank=2,
        epochs=1, coarse_epochs=0, vertex_epochs=0, penalty="concave", density_variation=1,
        fit_view_scale=False, progress=lambda progress: False)
    return [made.is_finished]


def try_seed(seed, model):
    """Makes a call of each function with arrays from a seed. Returns how many had an answer."""
    cases = Cases(seed)
    volume = cases.array(12, 10, 14)
    other = cases.array(12, 10, 14) if cases.chance(0.3) else cases.array(12, 10, 14, dtype="f4")
    tilts = np.linspace(-60, 60, 9)
    if cases.chance(0.3):
        tilts = cases.array(9)
    overflow = cases.one_of(["ignore", "raise"])
    return sum((check(scores, (volume, other), ("f4", "f4"), overflow),
                check(shells, (volume, other), ("f4", "f4"), overflow),
                check(model.sample_points, (cases.array(5, 3),), (PLACES,), overflow),
                check(first_step, (cases.array(9, 16, 16), tilts), ("f4", PLACES), overflow)))


def main():
    first, last, path = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    sys.path[:0] = sys.argv[4:5]
    import tomofield
    import logging
    logging.disable()
    model = tomofield.Model(path)
    answered = 0
    for seed in range(first, last + 1):
        print(seed, end="\r", file=sys.stderr, flush=True)  # the last one is what crashed
        answered += try_seed(seed, model)
    calls = 4 * (last - first + 1)
    print(f"{calls} calls, {answered} answered, {calls - answered} refused")


if __name__ == "__main__":
    main()
