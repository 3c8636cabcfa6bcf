"""The one place for numba's options, each with its reason."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import sigutils
from numba.core.ccallback import CFunc

from mjskip._compile.cache import attach_cache

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {
    "error_model": "numpy",  # division by zero gives inf, as in C: native callbacks must not raise
    "nogil": True,  # rollouts and batches call from threads
}
"""No fastmath: it would remove the checks for non-finite forces."""

LOOSE = frozenset({"contract", "reassoc", "arcp", "nsz", "afn"})
"""Sums in any order and approximate roots; infinities and not-a-number keep their meaning."""


def kernel(function: F) -> F:
    """Compile `function` with the options of this package; `.py_func` is its slow twin."""
    return _compile(function, OPTIONS)


VECTOR = frozenset({"contract", "reassoc", "nsz"})
"""Sums in any order, so that loops run in vector registers; infinities and not-a-number keep their meaning."""


def inlined(function: F) -> F:
    """The same for a part of kernels that is smaller than what a call of it costs."""
    return _compile(function, {**OPTIONS, "forceinline": True})


def vector_kernel(function: F) -> F:
    """The same for sums over many faces, in any order."""
    return _compile(function, {**OPTIONS, "fastmath": set(VECTOR)})


def picture_kernel(function: F) -> F:
    """The same for the optics of a picture, with `LOOSE` sums and roots."""
    return _compile(function, {**OPTIONS, "fastmath": set(LOOSE)})


def _compile(function: F, options: dict[str, Any]) -> F:
    named = {k: sorted(v) if isinstance(v, set) else v for k, v in options.items()}
    compiled: F = numba.njit(**options)(function)
    return compiled if numba.config.DISABLE_JIT else attach_cache(compiled, named)


def native(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile to a C function of this signature, callable by address from any thread."""
    options = {"error_model": OPTIONS["error_model"]}

    def compiled(function: Callable[..., Any]) -> Any:
        result = CFunc(function, sigutils.normalize_signature(signature), {}, options)
        attach_cache(result, options)
        result.compile()
        return result

    return compiled
