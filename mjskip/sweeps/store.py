"""Where the results of a sweep go: to memory, or to a Zarr store that survives its process.

A chunk of throws is one Zarr chunk of every result. Files appear whole or not at all (Zarr renames them), and
`status` comes last: a chunk whose status is there is finished.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mjskip.errors import MjskipError
from mjskip.files import reading, whole_file, writing
from mjskip.sweeps.job import RESULTS, WORDS, Question

if TYPE_CHECKING:
    import xarray as xr

Index = tuple[slice, ...]
WRITER = "`mjskip sweep --save`"


class Store(Protocol):
    """What a sweep writes to."""

    def finished(self, index: Index) -> bool:
        """Whether this chunk is there."""

    def write(self, index: Index, found: dict[str, Any]) -> None:
        """Keep a chunk."""

    def dataset(self) -> xr.Dataset:
        """All of it."""

    def close(self) -> None:
        """Nothing more is written."""


class MemoryStore:
    """Results in memory."""

    def __init__(self, job: Question) -> None:
        self._job = job
        shape = tuple(job.design.sizes.values())
        self._arrays: dict[str, Any] = {name: np.full(shape, np.nan) for name in job.results}
        self._arrays |= {name: np.full(shape, "", dtype=object) for name in job.words}

    def finished(self, index: Index) -> bool:
        """Whether this chunk is there."""
        return bool((self._arrays["status"][index] != "").all())

    def write(self, index: Index, found: dict[str, Any]) -> None:
        """Keep a chunk."""
        for name, values in found.items():
            self._arrays[name][index] = values

    def dataset(self) -> xr.Dataset:
        """All of it, as `open_sweep` would read it."""
        import xarray as xr

        job = self._job
        dims = list(job.design.sizes)
        return xr.Dataset(
            {
                name: (
                    dims,
                    np.asarray(values, dtype=str if name in job.words else None),
                    _about(job, name),
                )
                for name, values in self._arrays.items()
            },
            coords=job.design.coordinates(),
            attrs={"title": job.title, "request": json.dumps(job.request())},
        )

    def close(self) -> None:
        """Nothing more is written."""


class ZarrStore:
    """Results in a Zarr group."""

    def __init__(self, path: Path, group: Any, names: tuple[str, ...], lock: Any) -> None:
        self._path, self._group, self._names, self._lock = path, group, names, lock
        self._status = group["status"][...]

    def finished(self, index: Index) -> bool:
        """Whether this chunk was there when the store was opened."""
        return bool((np.asarray(self._status[index], dtype=object) != "").all())

    def write(self, index: Index, found: dict[str, Any]) -> None:
        """Keep a chunk; its status last."""
        with writing(self._path):
            for name in self._names:
                self._group[name][index] = found[name]

    def dataset(self) -> xr.Dataset:
        """All of it."""
        return open_sweep(self._path)

    def close(self) -> None:
        """Let others write to it."""
        self._lock.close()


def open_store(path: str | os.PathLike[str], job: Question, chunks: tuple[int, ...]) -> ZarrStore:
    """Make a store for a sweep, or open the one that is there.

    Raises:
        MjskipError: there is something else, a store of another request, one that another process writes to, or no
            `zarr`.
    """
    zarr = _zarr()
    path, request = Path(path), job.request()
    if not path.exists():
        with whole_file(path) as part:
            _make(zarr.create_group(part), job, chunks, request)
    group = _group(zarr, path)
    lock = _locked(path)
    try:
        with reading(path, what="a sweep", writer=WRITER):
            made = json.loads(group.attrs["request"])
            differ = list(_differences(made, json.loads(json.dumps(request))))
            if group["status"].chunks != chunks:
                differ.append(f"chunk was {group['status'].chunks}, now {chunks}")
            store = ZarrStore(path, group, (*job.results, *job.words), lock)
        if differ:
            raise MjskipError(
                f"{path} holds another sweep ({'; '.join(differ)}): ask for the same, or name another file"
            )
    except BaseException:
        lock.close()
        raise
    return store


def _locked(path: Path) -> Any:
    """Keep other processes from writing to a store, and remove what those that have ended left half written.

    The lock is on a file of the store that is only ever read, and goes with the process that holds it.
    """
    lock = (path / "zarr.json").open("rb")
    with suppress(ImportError):  # where there is no such lock, nothing is removed
        import fcntl

        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise MjskipError(
                f"{path} is being written by another process: wait for it, or name another file"
            ) from None
        except OSError:  # a file system without locks
            return lock
        for part in path.rglob("*.partial"):
            with suppress(OSError):
                part.unlink()
    return lock


def open_sweep(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a sweep; throws that are not done yet have status "".

    Raises:
        MjskipError: there is no sweep, or no `zarr`.
    """
    import xarray as xr

    path = Path(path)
    group = _group(_zarr(), path)
    with (
        reading(path, what="a sweep", writer=WRITER),
        xr.open_zarr(path, consolidated=False, decode_times=False) as opened,
    ):
        results = list(group.attrs.get("results", [*RESULTS, *WORDS]))
        data: xr.Dataset = opened.load()
    for name, variable in data.variables.items():
        if variable.dtype.kind == "T":
            words = np.array(variable.values.tolist(), dtype=str)
            data[name] = xr.Variable(variable.dims, words, variable.attrs)
    data.attrs.pop("results", None)
    return data.set_coords([name for name in data.data_vars if name not in results])[results]


def is_sweep(path: str | os.PathLike[str]) -> bool:
    """Whether a path looks like a store of a sweep."""
    return (Path(path) / "zarr.json").is_file()


def _about(job: Question, name: str) -> dict[str, str]:
    """Attributes of a result."""
    if name in job.words:
        return {"long_name": job.words[name]}
    units, text = job.results[name]
    return {"units": units, "long_name": text}


def _make(group: Any, job: Question, chunks: tuple[int, ...], request: dict[str, Any]) -> None:
    design, names = job.design, [*job.results, *job.words]
    attributes = {"title": job.title, "request": json.dumps(request)}
    group.attrs.update(
        attributes if names == [*RESULTS, *WORDS] else attributes | {"results": names}
    )
    for name, (dim, values, attributes) in design.coordinates().items():
        words = values.dtype.kind == "U"
        array = group.create_array(
            name, shape=values.shape, dtype=str if words else "f8", chunks=values.shape,
            dimension_names=(dim,), attributes=attributes,
        )  # fmt: skip
        array[...] = values.astype(object) if words else values
    for name in names:
        number = name in job.results
        group.create_array(
            name, shape=tuple(design.sizes.values()), chunks=chunks,
            dtype="f8" if number else str, fill_value=np.nan if number else "",
            dimension_names=tuple(design.sizes), attributes=_about(job, name),
        )  # fmt: skip


def _zarr() -> Any:
    try:
        import zarr
    except ImportError as error:
        raise MjskipError("Zarr stores need a package more: pip install 'mjskip[sweep]'") from error
    return zarr


def _group(zarr: Any, path: Path) -> Any:
    if not is_sweep(path):
        raise MjskipError(f"{path} is no sweep: give a store that `mjskip sweep` wrote")
    with reading(path, what="a sweep", writer=WRITER):
        group = zarr.open_group(path, mode="r+")
        _ = group.attrs["request"], group["status"]
    return group


def _differences(was: Any, now: Any, name: str = "") -> Any:
    """Lines that say what differs between two requests."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*was, *now]):
            yield from _differences(was.get(key), now.get(key), f"{name}.{key}" if name else key)
    elif was != now:
        yield f"{name} was {was}, now {now}"
