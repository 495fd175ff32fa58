"""Arrays that compiled functions find at addresses: each array that such a call is given costs it 100 ns, a number 10.

Whoever tells an address keeps the array as long as it is used; nothing checks where it ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

__all__ = ["address", "flags_at", "ints_at", "pointer", "words_at"]


@intrinsic
def pointer(_: Any, address: Any) -> Any:
    """An address as a pointer."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), made


@njit(inline="always")
def ints_at(address):
    """Whole numbers from an address on."""
    return carray(pointer(address), (2**40,), np.int64)


@njit(inline="always")
def words_at(address):
    """The same, as words."""
    return carray(pointer(address), (2**40,), np.uint64)


@njit(inline="always")
def flags_at(address):
    """The same of bytes that are true or false."""
    return carray(pointer(address), (2**40,), np.bool_)


def address(array: Any) -> int:
    """Where an array lies."""
    assert array.flags.c_contiguous
    return int(array.__array_interface__["data"][0])
