"""Input checks: every outside value is checked once, here, and an error names the bad field."""

from __future__ import annotations

import itertools
import math
import os
import re
import reprlib
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import numpy.typing as npt

from .limits import BOXES_MAX

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.unsignedinteger[Any]]  # of a label plane, see `hitplanes.planes.bits.label_plane`
Shape = tuple[int | None, ...]

SHOWN = 60  # most characters of a value that an error shows
GREY_MAX = 255  # greatest value of a pixel of an image

FLOAT_MAX = sys.float_info.max

FLOAT_BITS = 1023  # whole numbers of fewer bits than this fit a float
NAMES_SHOWN = 20  # most names that an error lists: beyond it the nearest name says more than a list


class InputError(ValueError):
    """Bad input. The message names the field, the row, what was expected and what came, in printable characters."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


@contextmanager
def within(place: str) -> Iterator[None]:
    """Put the place of a field in front of the errors raised inside, unless they name it: file, list, row."""
    try:
        yield
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(f"{place}: ") else f"{place}: {text}") from error


def array_of(
    field: str, values: object, shape: Shape | None = None, dtype: npt.DTypeLike | None = None
) -> npt.NDArray[Any]:
    """Convert a value as `numpy.asarray` does, and raise an InputError with the field's name if that fails.

    Values that numpy would change silently are refused, too: masked values, and booleans among numbers.
    """
    try:
        array = np.asarray(values, dtype)
    except (ValueError, TypeError, OverflowError) as error:
        of_shape = "" if shape is None else f" of shape {_spelled(shape)}"
        if "inhomogeneous" in str(error):  # numpy's word for rows that differ in length
            of_shape += " with rows of one length"
        raise InputError(f"{field}: expected an array{of_shape}, got {shown(values)}") from error
    if values is not array and array.dtype.kind in "biuf" and not _plain(values):
        _refuse_changed(field, values, array.dtype.kind == "b")
    return array


def each(field: str, value: object, n: int) -> npt.NDArray[Any]:
    """Repeat a single number n times; an array is returned as it is, for the next check."""
    if array_of(field, value).ndim == 0:
        _numeric(field, value, (), "iuf")  # the next check would quote it as a list
    return repeated(field, value, n)


def repeated(field: str, value: object, n: int) -> npt.NDArray[Any]:
    """Repeat a single number or word n times; an array is returned as it is, for the next check."""
    array = array_of(field, value)
    return np.broadcast_to(array, (n,)) if array.ndim == 0 else array


def reals(field: str, values: object, shape: Shape, limit: float = math.inf) -> Floats:
    """Check an array of finite numbers, anything that `numpy.asarray` takes, and return it as float64.

    In the shape None stands for any length; the limit is of absolute values. Errors name the field.
    """
    numbers = _numeric(field, values, shape, "iuf")
    if numbers.dtype.kind == "O":
        most = min(limit, FLOAT_MAX)
        _first_bad(field, numbers, np.abs(numbers) <= most, f"a number within ±{most:.15g}")
    array = _float64(numbers)
    if not all_within(array, -min(limit, FLOAT_MAX), min(limit, FLOAT_MAX)):
        _first_bad(field, array, np.isfinite(array), "a finite number")
        _first_bad(field, array, np.abs(array) <= limit, f"a number within ±{limit:.15g}")
    return array


def integers(field: str, values: object, shape: Shape, low: int, high: int) -> Ints:
    """Check an array of whole numbers in [low, high]; whole floats pass."""
    array = _numeric(field, values, shape, "iuf")
    whole = f"a whole number from {low} to {high}"
    if array.dtype.kind == "O":
        _first_bad(field, array, (array >= low) & (array <= high), whole)
    if array.dtype.kind == "f":
        array = _float64(array)
        _first_bad(field, array, (np.rint(array) == array) & (np.abs(array) <= 2.0**53), whole)
    if not all_within(array, low, high):
        _first_bad(field, array, (array >= low) & (array <= high), whole)
    return array.astype(np.int64)


def ids_of(field: str, values: object) -> npt.NDArray[Any]:
    """Convert ids of objects like `array_of`; for names the error says how to get ids of them."""
    array = array_of(field, values)
    if array.dtype.kind == "U":
        raise InputError(f"{field}: expected ids, got {shown(values)}: scene.find(name) is the id of an object")
    return array


def rising(array: Ints, count: int) -> bool:
    """Whether an array (n,) is strictly rising within 0 .. count - 1, and so has no number twice."""
    if not len(array):
        return True
    return bool(array[0] >= 0 and array[-1] < count and (array[1:] > array[:-1]).all())


def bools(field: str, values: object, shape: Shape) -> Bools:
    """Check an array of booleans; numbers 0 and 1 pass."""
    array = _numeric(field, values, shape, "biu")
    if array.dtype.kind != "b":
        good = (array == 0) | (array == 1)
        if not good.all():
            grey = array.min() >= 0 and array.max() == GREY_MAX
            _first_bad(field, array, good, f"0 or 1{' (of an image of grey: mask > 127)' if grey else ''}")
        return array.astype(np.bool_)
    return np.not_equal(array.view(np.uint8), 0)  # a view of other bytes as booleans may have any true byte


def real(field: str, value: object, low: float, high: float) -> float:
    """Check one finite number in [low, high]."""
    given = float(value) if type(value) is int and value.bit_length() < FLOAT_BITS else value
    if type(given) is float and low <= given <= high:
        return given
    number = given if type(given) is int else float(reals(field, given, ()))
    low, high = max(low, -FLOAT_MAX), min(high, FLOAT_MAX)
    if not low <= number <= high:
        raise InputError(f"{field}: expected a number from {low:.15g} to {high:.15g}, got {shown(value)}")
    return float(number)


def integer(field: str, value: object, low: int, high: int) -> int:
    """Check one whole number in [low, high], of any size."""
    whole = isinstance(value, int | np.integer) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not whole or not low <= int(value) <= high:  # type: ignore[call-overload]
        raise InputError(f"{field}: expected a whole number from {low} to {high}, got {shown(value)}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def flag(field: str, value: object) -> bool:
    """Check one boolean."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{field}: expected true or false, got {shown(value)}")
    return bool(value)


def choice(field: str, value: object, options: Iterable[str]) -> str:
    """Check that a value is one of the options; the error suggests the nearest."""
    names = options if isinstance(options, tuple) else list(options)
    if isinstance(value, str) and value in names:
        return value
    hint = suggestion(value, names)
    if not names:
        raise InputError(f"{field}: there is none to choose from, got {shown(value)}")
    listed = ", ".join(map(repr, names[:NAMES_SHOWN]))
    if len(names) > NAMES_SHOWN:
        listed += f" and {len(names) - NAMES_SHOWN} more"
    raise InputError(f"{field}: expected one of {listed}, got {shown(value)}{hint}")


def boxes_in(field: str, name: object) -> int | None:
    """Number of boxes in a name like "4 boxes"; None for any other name."""
    counted = re.fullmatch(r"([0-9]{1,4}) box(?:es)?", name) if isinstance(name, str) else None
    if counted is None:
        return None
    k = int(counted[1])
    if not 1 <= k <= BOXES_MAX:
        raise InputError(f"{field}: expected 1 to {BOXES_MAX} boxes, got {k}")
    return k


def suggestion(value: object, names: Iterable[str]) -> str:
    """Text that suggests the nearest name with the same first letter, in whatever case; empty if none is near."""
    import difflib  # only an error needs it

    text = value.casefold() if isinstance(value, str) else ""
    folded = {name.casefold(): name for name in names if name[:1].casefold() == text[:1]}
    near = difflib.get_close_matches(text, folded, n=1)
    return f" (did you mean {folded[near[0]]!r}?)" if near else ""


def path_of(field: str, value: object) -> Path:
    """Check a path, given as a text or a `pathlib` path; it need not exist."""
    if not (isinstance(value, str | PurePath) and value):  # Path("") would be the current folder
        raise InputError(f"{field}: expected a path, got {shown(value)}")
    text = str(value)
    try:
        os.fsencode(text)
    except UnicodeEncodeError as error:
        raise InputError(f"{field}: expected a path, got {shown(text)}, which holds half a letter") from error
    if "\0" in text:
        raise InputError(f"{field}: expected a path, got {shown(text)}, which holds a zero byte")
    return Path(value)


def listed(field: str, values: object, expected: str) -> list[Any]:
    """Convert any iterable to a list; a text or a mapping is refused."""
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) == 0:
        raise InputError(f"{field}: expected {expected}, got {shown(values)}")
    return list(values)


def printable(text: str) -> str:
    r"""Escape the characters of a text that a terminal or a page would obey or not show, as "\x7f" or "\u202e".

    These are control characters, line breaks, marks of writing direction, spaces other than " ", and lone surrogates.
    Escapes that are in the text stay as they are.
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def kind_of(value: object) -> str:
    """What a value is, for an error about its type."""
    return f"the class {value.__name__}, not one made of it" if isinstance(value, type) else type(value).__name__


def shown(value: object) -> str:
    """A short text of any value for an error, on one line, however long, deep or large the value is."""
    try:
        text = " ".join(_brief.repr(value).split())
    except (ValueError, RecursionError):  # a whole number of too many digits
        text = f"a {type(value).__name__} that is too long to show"
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


_brief = reprlib.Repr()
_brief.maxlist = _brief.maxtuple = _brief.maxset = _brief.maxdict = _brief.maxarray = SHOWN // 3
_brief.maxstring = _brief.maxother = _brief.maxlong = 2 * SHOWN


def _numeric(field: str, values: object, shape: Shape, kinds: str) -> npt.NDArray[Any]:
    array = array_of(field, values, shape)
    empty = not array.size and array.dtype.kind == "f"  # numpy makes an empty list an array of floats
    if array.dtype.kind not in kinds and not empty and not ("f" in kinds and _are_long(array)):
        kind = "booleans" if kinds.startswith("b") else "numbers" if shape else "a number"
        given = values if (array.dtype.kind in "US" and array is not values) or array.size > SHOWN else array.tolist()
        raise InputError(f"{field}: expected {kind}, got {shown(given)}")
    if array.shape == (0,) and shape[1:] and shape[0] in (None, 0) and None not in shape[1:]:
        array = array.reshape(0, *shape[1:])  # an empty list of points
    if len(array.shape) != len(shape) or any(e not in (None, g) for e, g in zip(shape, array.shape, strict=True)):
        raise InputError(f"{field}: expected shape {_spelled(shape)}, got {array.shape}")
    return array


def _are_long(array: npt.NDArray[Any]) -> bool:
    """Whether an array holds numbers, some of more than 64 bits, which numpy keeps as Python's own."""
    if array.dtype.kind != "O" or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in array.flat):
        return False
    return any(abs(v) >= 2**63 for v in array.flat)


def _plain(values: object) -> bool:
    """Whether nested lists hold nothing but Python's own numbers, or nothing but its booleans."""
    level: list[Any] = [values]
    while (kinds := set(map(type, level))) and kinds <= {list, tuple}:
        level = list(itertools.chain.from_iterable(level))
    return kinds <= {int, float} or kinds == {bool}


def _refuse_changed(field: str, values: object, booleans: bool) -> None:
    """Refuse masked values, and booleans unless all values are booleans."""
    if isinstance(values, np.ndarray) and np.ma.is_masked(values):
        place = _place(np.argwhere(np.ma.getmaskarray(values))[0].tolist())
        raise InputError(f"{field}{place}: expected a value, got a masked one")
    for i, value in enumerate(values if isinstance(values, list | tuple) else ()):
        is_boolean = isinstance(value, bool | np.bool_) or (isinstance(value, np.ndarray) and value.dtype.kind == "b")
        if is_boolean and not booleans:
            raise InputError(f"{field}[{i}]: expected a number like the others, got {shown(value)}")
        _refuse_changed(f"{field}[{i}]", value, booleans)


def _float64(array: npt.NDArray[Any]) -> Floats:
    """Convert numbers to float64; long doubles beyond its range become infinite, which the caller refuses."""
    if array.dtype.itemsize <= 8:
        return array.astype(np.float64)
    with np.errstate(over="ignore"):
        return array.astype(np.float64)


def all_within(array: npt.NDArray[Any], low: float, high: float) -> bool:
    """Whether all numbers lie in [low, high]; False if any is NaN."""
    return not array.size or bool(array.min() >= low and array.max() <= high)


def _first_bad(field: str, array: npt.NDArray[Any], good: Bools | np.bool_, expected: str) -> None:
    if np.all(good):
        return
    row = tuple(np.argwhere(~np.asarray(good))[0].tolist())
    got = shown(array[row]) if array.dtype.kind == "O" else array[row]
    raise InputError(f"{field}{_place(row)}: expected {expected}, got {got}")


def _place(row: Iterable[int]) -> str:
    return "".join(f"[{i}]" for i in row)


def _spelled(shape: Shape) -> str:
    return "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
