"""The one place for numba's options, each with its reason."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {
    "cache": True,  # compile once per machine, not once per process
    "error_model": "numpy",  # division by zero gives inf, as in C: native callbacks must not raise
    "nogil": True,  # rollouts and batches call from threads
}
"""No fastmath: it would remove the checks for non-finite forces."""


def kernel(function: F) -> F:
    """Compile `function` with the options of this package; `.py_func` is its slow twin."""
    compiled: F = numba.njit(**OPTIONS)(function)
    return compiled


def picture_kernel(function: F) -> F:
    """The same for the optics of a picture, where sums may be taken in any order and roots be approximate.

    Infinities and not-a-number keep their meaning.
    """
    loose = {"contract", "reassoc", "arcp", "nsz", "afn"}
    compiled: F = numba.njit(**OPTIONS, fastmath=loose)(function)
    return compiled


def native(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile to a C function of this signature, callable by address from any thread."""
    return lambda function: numba.cfunc(signature, cache=True, error_model="numpy")(function)
