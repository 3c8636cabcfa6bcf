"""Where compiled kernels are kept, under a name that says what they are made of.

numba stamps an entry with the text of one file, the kernel's own. Here the folder is named by a hash over that
file and every file of this package that it imports, directly or not, the versions of numba, llvmlite and rocket-fft, the
processor and the options: code of another origin has another name, so nothing stale is ever run. An entry that
cannot be read is compiled again; where entries cannot be written, one warning is given and the code runs unkept.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import time
import warnings
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba.core import caching

from mjskip.errors import MjskipWarning

PACKAGE = Path(__file__).parents[1]
watchers: list[Callable[[], None]] = []
"""Called whenever a function is about to be compiled, for those who show that."""
IMPORT = re.compile(
    rf"^(?:from ({PACKAGE.name}[\w.]*) import (\([^)]*\)|[^\n]*)|import ([\w., ]+))", re.MULTILINE
)
"""Import statements of this package outside of any block: parsing whole files takes as long as importing MuJoCo."""

UNUSED_DAYS = 30
"""Folders of other origins that nobody made or used for so long are removed when a new one is made."""


def attach_cache(compiled: Any, options: dict[str, Any]) -> Any:
    """Let a dispatcher or C function of numba keep its machine code; `options` are part of its name."""
    function: Callable[..., Any] = compiled.__wrapped__
    compiled._cache = KernelCache(
        function, fingerprint(Path(function.__code__.co_filename), options)
    )
    return compiled


def fingerprint(file: Path, options: dict[str, Any]) -> str:
    """Hash of everything that decides what a kernel of this file compiles to."""
    parts = [_compiler(), repr(sorted(options.items())), *map(_text, _sources(file))]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


@cache
def _compiler() -> str:
    cpu = llvmlite.binding.get_host_cpu_name()
    features = llvmlite.binding.get_host_cpu_features().flatten()
    fft = version("rocket-fft")  # whose functions compiled code calls by name
    return f"{numba.__version__} {llvmlite.__version__} {fft} {cpu} {features}"


@cache
def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@cache
def _sources(file: Path) -> tuple[Path, ...]:
    """The file and all files of this package that it imports, directly or through others."""
    found, waiting = {file}, [file]
    while waiting:
        new = _imported(waiting.pop()) - found
        found |= new
        waiting += new
    return tuple(sorted(found))


@cache
def _imported(file: Path) -> frozenset[Path]:
    """Files of this package that a file names in its import statements."""
    names: set[str] = set()
    for module, imported, alone in IMPORT.findall(_text(file)):
        if module:
            parts = re.sub(r"#.*", "", imported).strip("()").split(",")
            names |= {module} | {f"{module}.{part.split()[0]}" for part in parts if part.strip()}
        else:
            names |= {part.split()[0] for part in alone.split(",")}
    inside = (name.split(".")[1:] for name in names if name.startswith(f"{PACKAGE.name}."))
    paths = (PACKAGE.joinpath(*parts).with_suffix(".py") for parts in inside)
    return frozenset(path for path in paths if path.is_file())


def _folder(file: Path, name: str) -> Path:
    """Where code of this name is, or can be, kept: NUMBA_CACHE_DIR, beside the source, or the user's cache."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    roots = [Path(chosen)] if chosen else [file.parent / "__pycache__", user / "mjskip"]
    for root in roots:
        if (root / name).is_dir():
            return root / name
    for root in roots:
        existing = next(path for path in (root, *root.parents) if path.exists())
        if os.access(existing, os.W_OK):
            return root / name
    return roots[0] / name


class _Locator(caching._CacheLocator):  # type: ignore[misc]
    """Tells numba the folder, and that what is in it is fresh."""

    def __init__(self, function: Callable[..., Any], mark: str) -> None:
        self._py_file = function.__code__.co_filename  # numba's warnings name it
        self._line = function.__code__.co_firstlineno
        file = Path(self._py_file)
        self.path = _folder(file, f"{file.stem}-{mark}")

    def get_cache_path(self) -> str:
        return str(self.path)

    def get_source_stamp(self) -> str:
        return self.path.name

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        """Make the folder, and remove those of other origins that are no longer used."""
        if self.path.is_dir():
            return
        self.path.mkdir(parents=True, exist_ok=True)
        stem = self.path.name.rpartition("-")[0]
        for other in self.path.parent.glob(f"{stem}-{'[0-9a-f]' * 16}"):
            if other.stat().st_mtime < time.time() - 86400 * UNUSED_DAYS:
                shutil.rmtree(other, ignore_errors=True)


class _CheckedFile(caching.IndexDataCacheFile):  # type: ignore[misc]
    """numba's files with a checksum before the machine code, which must not be run if it is damaged."""

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(content).digest() + content)

    def _load_data(self, name: str) -> Any:
        stored = Path(self._data_path(name)).read_bytes()
        if hashlib.sha256(stored[32:]).digest() != stored[:32]:
            raise OSError(f"{name} is damaged")
        return pickle.loads(stored[32:])


class KernelCache(caching.FunctionCache):  # type: ignore[misc]
    """The cache of one kernel: never an error, whatever is wrong with its files."""

    def __init__(self, function: Callable[..., Any], mark: str) -> None:
        locator = _Locator(function, mark)

        class Implementation(caching.CompileResultCacheImpl):  # type: ignore[misc]
            def __init__(self, _: Any) -> None:
                self._locator, self._lineno = locator, function.__code__.co_firstlineno
                self._filename_base = self.get_filename_base(function.__qualname__, "")

        self._impl_class = Implementation
        super().__init__(function)
        self._cache_file = _CheckedFile(
            str(locator.path), self._impl.filename_base, locator.get_source_stamp()
        )

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Compiled code from the files; None, and the files forgotten, where they are damaged."""
        try:
            found = super().load_overload(signature, target)
        except Exception:  # unpickling garbage raises anything
            with _not_cached(self._cache_path):
                Path(self._cache_file._index_path).unlink(missing_ok=True)
            found = None
        if found is None:
            for watcher in watchers:
                watcher()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep compiled code, if that can be done."""
        with _not_cached(self._cache_path):
            super().save_overload(signature, data)


class _not_cached:
    """One warning in a process if files cannot be written; the code runs all the same."""

    warned = False

    def __init__(self, folder: str) -> None:
        self._folder = folder

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> bool:
        if not isinstance(error, Exception):
            return False
        if not _not_cached.warned:
            _not_cached.warned = True
            warnings.warn(
                f"compiled code is not kept in {self._folder} ({error}): each run compiles anew; free "
                "the disk, or name a folder that can be written to in NUMBA_CACHE_DIR",
                MjskipWarning,
                stacklevel=2,
            )
        return True
