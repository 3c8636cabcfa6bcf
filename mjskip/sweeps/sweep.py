"""Sweeps: a grid of throws, written chunk by chunk, that goes on where it stopped."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from mjskip._typing import Array, PathLike, Progress
from mjskip.checks import check_choice, check_count, check_path, check_positive, check_type
from mjskip.errors import MjskipWarning
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.sweeps.batch import AIRS, MAX_THREADS, Air
from mjskip.sweeps.design import Design
from mjskip.sweeps.job import Job, Question, run_chunk
from mjskip.sweeps.store import MemoryStore, Store, open_store
from mjskip.throws.engines import INTEGRATORS
from mjskip.throws.recording import Limits
from mjskip.throws.reference import FIXED_STEP
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.simulate import ENGINES, EngineName, largest_timestep
from mjskip.throws.throw import Throw

if TYPE_CHECKING:
    import xarray as xr

CHUNK = 256
"""Throws that are done, written and forgotten together, unless another number is given."""


def sweep(
    scene: Scene | Stone | PathLike = "lake",
    vary: Mapping[str, Sequence[Any] | Array] | None = None,
    *,
    samples: Mapping[str, Array] | None = None,
    scatter: Mapping[str, Array] | None = None,
    throw: Throw | None = None,
    water: Water | None = None,
    engine: EngineName = "reference",
    integrator: str | None = None,
    timestep: float | None = None,
    limits: Limits | None = None,
    air: Air = "adaptive",
    path: PathLike | None = None,
    chunk: int = CHUNK,
    threads: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Throw over a grid of parameters and say what every throw did.

    Parameters are those of `Throw` (speed, spin, attack, descent, bank, wobble, height), of the stone (radius,
    thickness, mass, stone_density: the mesh is stretched) and of the water (water_density, air_density,
    gate, law). A throw that is refused or diverges is a row with a status and a reason.

    Args:
        scene: a scene, its path or name, or a stone.
        vary: values by parameter; each parameter becomes a dimension.
        samples: values by parameter, all along one dimension "sample": `latin_hypercube` or `normal` of
            `mjskip.sweeps.design`.
        scatter: additions by parameter along a dimension "member": an ensemble around every point, such
            as `normal({"attack": (0, 0.02)}, count=32, seed=0)`.
        throw: what is not varied; the scene's if None.
        water: the fluid; the scene's if None.
        engine: "reference", the pure integrator, over threads; or "mujoco".
        integrator: of the engine; rk4, or the scene's.
        timestep: [s]; the scene's if None, or 5e-4.
        limits: what counts as a skip and when a throw is over.
        air: of the reference engine, "adaptive" or "fixed" (see `mjskip.sweeps.batch`).
        path: Zarr store; in memory only if None. A store that is there is gone on with.
        chunk: throws that are done and written together.
        threads: of the reference engine on this machine; as many as there are processors if None.
        scheduler: address of a Dask scheduler, tcp://host:port, whose workers do the throws.
        progress: called with the throws done and to do.

    Returns:
        The Dataset: `skips`, `distance` and so on over the named dimensions, with units, `status` and
        `reason`; its attribute `request` is the provenance as JSON.

    Raises:
        ValueError: an argument is not allowed.
        MjskipError: the store was made by another request, or the scheduler is lost.
    """
    design = Design(
        axes={} if vary is None else vary,
        samples={} if samples is None else samples,
        scatter={} if scatter is None else scatter,
    )
    job = _job(scene, design, throw, water, engine, integrator, timestep, limits, air)
    job.limits.check_steps(job.timestep, bodies=int(engine == "mujoco"))
    _warn_timestep(job)
    return ask(job, path=path, chunk=chunk, threads=threads, scheduler=scheduler, progress=progress)


def ask(
    job: Question,
    *,
    path: PathLike | None,
    chunk: int,
    threads: int | None,
    scheduler: str | None,
    progress: Progress | None,
) -> xr.Dataset:
    """Do a sweep chunk by chunk, here or on a cluster; arguments as for `sweep`."""
    check_count("chunk", chunk)
    if threads is not None:
        check_count("threads", threads, high=MAX_THREADS)
    if scheduler is not None:
        check_type("scheduler", scheduler, str, "give an address such as tcp://127.0.0.1:8786")
    shape = chunk_shape(tuple(job.design.sizes.values()), chunk)
    place: Store = (
        MemoryStore(job) if path is None else open_store(check_path("path", path), job, shape)
    )
    try:
        _finish(place, job, shape, threads, scheduler, progress)
        return place.dataset()
    finally:
        place.close()


def _finish(
    place: Store,
    job: Question,
    shape: tuple[int, ...],
    threads: int | None,
    scheduler: str | None,
    progress: Progress | None,
) -> None:
    """Do the chunks that the store lacks."""
    todo, done = [], 0
    for index in _chunks(job.design, shape):
        if place.finished(index):
            done += _size(index)
        else:
            todo.append(index)
    if progress:
        progress(done, job.design.size)

    def take(index: tuple[slice, ...], found: dict[str, Any]) -> None:
        nonlocal done
        place.write(index, found)
        done += _size(index)
        if progress:
            progress(done, job.design.size)

    def tell(within: int) -> None:
        if progress:
            progress(done + within, job.design.size)

    if scheduler is None:
        for index in todo:
            take(index, run_chunk(job, index, threads=threads, progress=tell))
    elif todo:
        from mjskip.sweeps.cluster import run_on_cluster

        run_on_cluster(scheduler, job, todo, take)


def chunk_shape(sizes: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Shape of blocks of at most `most` throws: whole in the last dimensions, parts of the first."""
    shape = []
    for size in reversed(sizes):
        part = min(size, max(most, 1))
        shape.append(part)
        most //= part
    return tuple(reversed(shape))


def _chunks(design: Design, shape: tuple[int, ...]) -> list[tuple[slice, ...]]:
    parts = [
        [slice(first, min(first + step, size)) for first in range(0, size, step)]
        for size, step in zip(design.sizes.values(), shape, strict=True)
    ]
    return list(product(*parts))


def _size(index: tuple[slice, ...]) -> int:
    return int(np.prod([part.stop - part.start for part in index]))


def _job(
    scene: Scene | Stone | PathLike,
    design: Design,
    throw: Throw | None,
    water: Water | None,
    engine: EngineName,
    integrator: str | None,
    timestep: float | None,
    limits: Limits | None,
    air: Air,
) -> Job:
    check_choice("engine", engine, ENGINES)
    check_choice("air", air, AIRS)
    if integrator is not None:
        known = FIXED_STEP if engine == "reference" else INTEGRATORS
        check_choice(f"integrator of the {engine} engine", integrator, known)
    for name, value, kind in (
        ("throw", throw, Throw),
        ("water", water, Water),
        ("limits", limits, Limits),
    ):
        if value is not None:
            check_type(name, value, kind)
    loaded = None if isinstance(scene, Stone) else scene
    if loaded is not None and not isinstance(loaded, Scene):
        loaded = load_scene(loaded)
    default = 5e-4 if loaded is None else float(loaded.model.opt.timestep)
    timestep = default if timestep is None else timestep
    check_positive(timestep=timestep)
    gravity = (0.0, 0.0, -9.81)
    if loaded is not None:
        gx, gy, gz = map(float, loaded.model.opt.gravity)
        gravity = (gx, gy, gz)
    return Job(
        stone=scene if isinstance(scene, Stone) else loaded.stone if loaded else Stone.pebble(),
        scene=loaded if engine == "mujoco" else None,
        throw=throw or (loaded.throw if loaded else Throw()),
        water=water or (loaded.water if loaded else Water()),
        design=design,
        engine=engine,
        integrator=integrator or ("rk4" if engine == "reference" else None),
        timestep=timestep,
        limits=limits or Limits(),
        gravity=gravity,
        air=air,
    )


def _warn_timestep(job: Job) -> None:
    """Warn once for the fastest throw of the thinnest stone."""
    axes = {**job.design.axes, **job.design.samples}
    speed = float(np.max(axes.get("speed", job.throw.speed)))
    thin = float(np.min(axes.get("thickness", job.stone.thickness)))
    limit = largest_timestep(job.stone, speed) * thin / job.stone.thickness
    if job.timestep > limit * (1.0 + 1e-9):
        warnings.warn(
            f"time step {job.timestep:g} s is too large at {speed:g} m/s: skips may be numerical; use at "
            f"most {limit:.2g} s",
            MjskipWarning,
            stacklevel=3,
        )
