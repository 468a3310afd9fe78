"""What functions take from users: sentences for values of another type."""

import functools
import itertools
import os
import sys
from typing import (Any, Callable, Dict, Iterator, List, Literal, Mapping, Sequence, Tuple, Type,
                    Union, get_args, get_origin, get_type_hints)

import numpy as np

from . import _core
from ._core import Error
from .options import Options

Path = Union[str, "os.PathLike[str]"]

LONGEST_SHOWN = 100  # characters of a value in a sentence
NUMPY_DEPTH = 32  # of the sequences that numpy makes one array of
SMALLEST_FLOAT = float(np.finfo(np.float32).tiny)  # in full precision
LIMITS = ((-sys.float_info.max, sys.float_info.max), (0, 2**64 - 1), (-2**63, 2**63 - 1),
          (-2**31, 2**31 - 1))  # of the numbers of C++


def shown(value: object) -> str:
    """Return a value as a sentence shows it: on one line, which may be cut."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python does not write so many digits
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def path_of(value: object, what: str) -> str:
    """Return a path as a text. `what` says in a refusal what it names: "the model"."""
    try:
        path = os.fsdecode(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{what} is a path, a str or a pathlib.Path, not {shown(value)}") from None
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        raise Error(f"{what} cannot be {shown(path)}: no path holds such a character") from None
    if "\0" in path:
        raise Error(f"{what} cannot be {shown(path)}: no path holds a null character")
    return path


def number_of(value: object, what: str) -> float:
    """Return a real number."""
    number = _scalar(value)
    if not _is_number(number, (int, float, np.integer, np.floating)):
        raise TypeError(f"{what} is a number, not {shown(value)}")
    try:
        return float(number)
    except OverflowError:
        raise Error(f"{what} is a number up to {sys.float_info.max}, not {shown(number)}") from None


def whole_number_of(value: object, what: str) -> int:
    """Return a whole number."""
    number = _scalar(value)
    if not _is_number(number, (int, np.integer)):
        raise TypeError(f"{what} is a whole number, not {shown(value)}")
    return int(number)


def count_of(value: object, what: str) -> int:
    """Return a whole number that C++ can count."""
    number = whole_number_of(value, what)
    if not -2**63 <= number < 2**63:
        raise Error(f"{what} is a whole number up to {2**63 - 1}, not {shown(number)}")
    return number


def numbers_of(values: Any, count: int, one_of: Callable[[object, str], float], what: str) -> Any:
    """Return a tuple of `count` numbers, each as one_of() returns it."""
    parts = values if isinstance(values, (tuple, list)) else as_array(values).ravel().tolist()
    if len(parts) != count:
        raise TypeError(f"{what} is {count} numbers, not {shown(values)}")
    return tuple(one_of(part, what) for part in parts)


def switch_of(value: object, what: str) -> bool:
    """Return True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what} is True or False, not {shown(value)}")
    return bool(value)


def text_of(value: object, what: str) -> str:
    """Return a text."""
    if not isinstance(value, str):
        raise TypeError(f"{what} is a text, not {shown(value)}")
    if said(value) != value:
        raise Error(f"{what} '{said(value)}' is no text: give one in Unicode")
    return value


def said(text: object) -> str:
    r"""Return a text for messages: bytes of a file's name that are not UTF-8 become \xfc."""
    try:
        return os.fsencode(str(text)).decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:  # half of a pair of surrogates
        return str(text).encode("utf-8", "backslashreplace").decode("utf-8")


def array_of(value: Any, numbers: Type[Any] = np.float32) -> Any:
    """Return an array of real numbers of one type, as the compiled part reads them from memory. All
    arrays of users pass here: numpy would drop imaginary parts, and masks also of an object's array
    and of the parts of a sequence, and read texts and dates as numbers."""
    if is_masked(value):
        raise Error("an array with masked elements says nothing in their places: fill them "
                    "(numpy.ma.filled), or leave them out")
    array = (as_array(value) if hasattr(value, "__array__")
             else _made("an array of numbers is needed", np.asarray, value))
    if array.dtype.kind not in "biuf":
        raise Error(f"an array of real numbers is needed, not one of type {array.dtype}")
    if array.size * np.dtype(numbers).itemsize >= 2**63:
        raise Error(f"there is too little memory for an array of {array.size} numbers")
    if numbers is np.float32 and array.dtype.kind in "iuf" and array.dtype.itemsize > 2:
        _made("an array of real numbers is needed", _require_differences, np.asarray(array))
    with np.errstate(all="ignore", over="raise"):
        return _made(f"an array of type {array.dtype} has numbers that are too large",
                     np.require, array, numbers, ("C", "A", "E"))


def places_of(value: Any, what: str) -> Any:
    """Return an array of angles or positions, which are numbers alone."""
    if any(leaf.dtype.kind == "b" for leaf in _leaves(value)):
        raise Error(f"{what} are numbers, not True or False")
    return array_of(value, np.float64)


def is_masked(value: Any) -> bool:
    """Return True if an element of an array, or of arrays in sequences, is masked."""
    return any(np.ma.is_masked(leaf) for leaf in _leaves(value))  # type: ignore[no-untyped-call]


def chosen(choices: _core.Choices, given: Mapping[str, object]) -> _core.Choices:
    """Set options among compiled choices, and return these."""
    for name, value in given.items():
        if name not in Options.__annotations__:
            raise TypeError(no_option(name))
        if isinstance(value, np.bool_):
            value = bool(value)
        try:
            if _would_be_misread(name, value):
                raise TypeError
            setattr(choices, name, value)
        except TypeError:
            if beyond := _beyond(name, value):
                raise Error(f"the option {name} takes numbers {beyond}, not {shown(value)}"
                            ) from None
            raise TypeError(f"the option {name} cannot be {shown(value)}: give {_kind_of(name)}"
                            ) from None
    return choices


def no_option(name: str) -> str:
    """Return a sentence with the options that are most like this one, if there are any."""
    return f"there is no option '{said(name)}'{suggestion(_core.nearest_options(said(name)))}"


def suggestion(nearest: Sequence[str]) -> str:
    """Return a question in brackets after an unknown name; nothing if no name is like it."""
    return f" (did you mean {' or '.join(nearest)}?)" if nearest else ""


def _scalar(value: Any) -> Any:
    """Return the number of an array without axes, and any other value as it is."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _is_number(value: object, types: Tuple[type, ...]) -> bool:
    return isinstance(value, types) and not isinstance(value, (bool, np.timedelta64))


def as_array(value: object) -> Any:
    """Return an array with its mask, if it has one; one without numbers for what is no array, which
    the compiled part refuses. Raise Error with the reason of an array that cannot be read."""
    try:
        return np.asanyarray(value)
    except MemoryError as error:
        raise Error(f"there is too little memory for an array: {error}") from None
    except Exception as error:  # of any object's own method
        if hasattr(value, "__array__"):
            raise Error(f"an array of type {type(value).__name__} cannot be read: {shown(error)}"
                        ) from None
        return np.empty(0, object)


def _require_differences(array: Any) -> None:
    """Refuse numbers that 32-bit floats would round to zeros, or to steps which are as large as
    their differences, section by section."""
    if array.dtype == np.float32 or array.ndim < 2:
        return
    largest_of_all = 0.0
    with np.errstate(all="ignore"):
        for section in array:
            section = section[np.isfinite(section)]
            largest = float(np.abs(section).max(initial=0))
            spread = float(np.std(section)) if section.size else 0.0
            largest_of_all = max(largest_of_all, largest)
            if 0 < spread < 2 * 2.0**-23 * largest:
                raise Error(f"an array of type {array.dtype} has numbers up to {largest:.3g} that "
                            f"differ by {spread:.3g}, which is lost in the 32-bit floats that are "
                            "computed with: subtract their mean")
    if 0 < largest_of_all < SMALLEST_FLOAT:
        raise Error(f"an array of type {array.dtype} has numbers up to {largest_of_all:.3g}, which "
                    "32-bit floats do not hold: multiply them by a number")


def _made(otherwise: str, make: Callable[..., Any], *arguments: Any) -> Any:
    """Return the array that a function of numpy makes. If that raises, `otherwise` says what is
    wrong: numpy may also be told to refuse numbers (np.seterr, python -W error)."""
    try:
        return make(*arguments)
    except Error:
        raise
    except MemoryError as error:
        raise Error("there is too little memory for a copy of an array that is computed with: "
                    f"{error}") from None
    except Exception:
        raise Error(otherwise) from None


def _leaves(value: object) -> Iterator[Any]:
    """Yield the arrays that a value consists of, as deep as numpy reads sequences. Python's int and
    float are left out: there may be many, and they are what they seem."""
    level: List[Any] = [value]
    for _ in range(NUMPY_DEPTH + 1):
        types = set(map(type, level))
        if types <= {int, float}:
            return
        if not types <= {list, tuple}:
            yield from (as_array(part) for part in level if not _is_sequence(part))
            level = [part for part in level if _is_sequence(part)]
        level = list(itertools.chain.from_iterable(level))


def _is_sequence(value: object) -> bool:
    return (isinstance(value, Sequence) and not hasattr(value, "__array__")
            and not isinstance(value, (str, bytes, bytearray, memoryview)))


def _would_be_misread(name: str, value: Any) -> bool:
    """Return True if pybind11 would take True for 1, cut a fraction off, drop imaginary parts or
    masks, read a text as a number, or count days."""
    if isinstance(value, bool):
        return "True or False" not in _kind_of(name)
    if is_masked(value) or any(leaf.dtype.kind in "bcmM" for leaf in _leaves(value)):
        return True
    types = _number_types(name)
    if not types or value is None or isinstance(value, str):
        return False
    parts = np.ravel(value) if isinstance(value, np.ndarray) else value
    return not all(_is_number(_scalar(part), types)
                   for part in (parts if isinstance(parts, (tuple, list, np.ndarray)) else [value]))


def _beyond(name: str, value: Any) -> str:
    """Return in words which limit of its type a whole number exceeds, or nothing."""
    numbers = value if isinstance(value, (tuple, list)) else [value]
    are_whole = all(_is_number(number, (int, np.integer)) for number in numbers)
    if "number" not in _kind_of(name) or not are_whole:
        return ""
    for low, high in LIMITS:
        if all(_takes(name, len(numbers) * [end] if numbers is value else end)
               for end in (low, high)):
            return f"up to {high}" if max(numbers) > high else f"from {low} on"
    return ""


def _takes(name: str, value: Any) -> bool:
    try:
        setattr(_core.Choices(), name, value)
    except TypeError:
        return False
    return True


@functools.lru_cache(maxsize=None)
def _number_types(name: str) -> Tuple[type, ...]:
    """Return the types of the numbers that an option takes, or none if it takes no numbers."""
    kind = _kind_of(name)
    if "a number" in kind:
        return (int, float, np.integer, np.floating)
    return (int, np.integer) if "whole number" in kind or any(map(str.isdigit, kind)) else ()


@functools.lru_cache(maxsize=None)
def _kind_of(name: str) -> str:
    """Return in words what an option takes."""
    return _words_for(get_type_hints(Options, {"os": os})[name])


def _words_for(hint: Any) -> str:
    words: Dict[Any, str] = {int: "a whole number", float: "a number", str: "a text",
                             bool: "True or False", type(None): "None"}
    if hint in words:
        return words[hint]
    if get_origin(hint) is os.PathLike:
        return "a path"
    inner = get_args(hint)
    if get_origin(hint) is Literal:
        return " or ".join(repr(value) for value in inner)
    if get_origin(hint) is tuple:
        return f"{len(inner)} whole numbers"
    has_path = any(get_origin(kind) is os.PathLike for kind in inner)
    return " or ".join(_words_for(kind) for kind in inner if not (has_path and kind is str))
