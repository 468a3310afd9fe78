"""What functions take from users: sentences for values of another type."""

import os
from typing import Any, Dict, Literal, Mapping, Sequence, Union, get_args, get_origin, get_type_hints

import numpy as np

from . import _core
from .options import Options

Path = Union[str, "os.PathLike[str]"]


def path_of(value: object, what: str) -> str:
    """Return a path as a text. `what` says in a refusal what it names: "the model"."""
    try:
        return os.fsdecode(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{what} is a path, a str or a pathlib.Path, not {value!r}") from None


def number_of(value: object, what: str) -> float:
    """Return a real number."""
    if (isinstance(value, (bool, np.bool_))
            or not isinstance(value, (int, float, np.integer, np.floating))):
        raise TypeError(f"{what} is a number, not {value!r}")
    return float(value)


def whole_number_of(value: object, what: str) -> int:
    """Return a whole number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{what} is a whole number, not {value!r}")
    return int(value)


def text_of(value: object, what: str) -> str:
    """Return a text."""
    if not isinstance(value, str):
        raise TypeError(f"{what} is a text, not {value!r}")
    return value


def chosen(choices: _core.Choices, given: Mapping[str, object]) -> _core.Choices:
    """Set options among compiled choices, and return these."""
    for name, value in given.items():
        if name not in Options.__annotations__:
            raise TypeError(no_option(name))
        try:
            setattr(choices, name, value)
        except TypeError:
            raise TypeError(f"the option {name} cannot be {value!r}: give {_kind_of(name)}"
                            ) from None
    return choices


def no_option(name: str) -> str:
    """Return a sentence with the options that are most like this one, if there are any."""
    return f"there is no option '{name}'{suggestion(_core.nearest_options(name))}"


def suggestion(nearest: Sequence[str]) -> str:
    """Return a question in brackets after an unknown name; nothing if no name is like it."""
    return f" (did you mean {' or '.join(nearest)}?)" if nearest else ""


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
