"""What a throw did: the motion at every step, and every touch of the water."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_count, check_mapping, check_number, check_vector
from mjskip.files import reading, whole_file

if TYPE_CHECKING:
    import xarray as xr

    from mjskip.waves.recording import SurfaceRecording

GRAVITY = (0.0, 0.0, -9.81)
"""Unless a scene or an argument says otherwise [m/s^2]."""

ENDS: dict[str, str] = {
    "sunk": "then it sank",
    "at rest": "then it came to rest",
    "planing": "then it ploughed on without leaving the water",
    "out of time": "when the time was up",
    "left the lake": "then it left the lake",
    "diverged": "then its motion was no longer finite",
}
"""How a run can end, and how a sentence about its skips goes on; in the order of the kernels' codes."""


@dataclass(frozen=True, kw_only=True)
class Moment:
    """The stone as it meets or leaves the water.

    Attributes:
        time: [s].
        position: centre of mass (x, y, z) [m].
        velocity: of the centre of mass, world frame (x, y, z) [m/s].
        attack: tilt of the disc to the water against the heading, nose up [rad].
        bank: positive when the upper disc normal leans to the left of the heading [rad].
        spin: about the upper disc normal, counter-clockwise from above positive [rad/s].
    """

    time: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    attack: float
    bank: float
    spin: float

    @property
    def speed(self) -> float:
        """Magnitude of the velocity [m/s]."""
        return float(np.linalg.norm(self.velocity))

    def summary(self) -> dict[str, Any]:
        """The same for JSON and tables: angles in degrees, spin in revolutions per second."""
        return {
            "time": self.time,
            "position": list(self.position),
            "velocity": list(self.velocity),
            "attack_deg": math.degrees(self.attack),
            "bank_deg": math.degrees(self.bank),
            "spin_rev_s": self.spin / (2.0 * math.pi),
        }


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One touch: from the lowest point meeting the water until nothing is wet.

    Attributes:
        entry: the stone as it touched.
        exit: as it left; None if it never did.
        depth: deepest immersion of the lowest point [m].
        impulse: of the water's force over the touch, world frame [N s].
        airtime: time in the air after it [s]; 0 if it never left. The last airtime of a run may
            be cut short by the end of the run.
    """

    entry: Moment
    exit: Moment | None
    depth: float
    impulse: tuple[float, float, float]
    airtime: float

    def summary(self) -> dict[str, Any]:
        """For JSON and tables; `exit` is None if the stone never left."""
        return {
            "entry": self.entry.summary(),
            "exit": None if self.exit is None else self.exit.summary(),
            "depth": self.depth,
            "impulse": list(self.impulse),
            "airtime": self.airtime,
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trajectory:
    """One stone's motion, a row per step, in the world frame and SI units.

    Attributes:
        time: (n,) [s].
        position: centre of mass (n, 3) [m].
        q: body orientation (n, 4), w-x-y-z, body to world.
        P: momentum (n, 3) [kg m/s].
        L: angular momentum about the centre of mass (n, 3) [kg m^2/s].
        velocity: of the centre of mass (n, 3) [m/s].
        omega: angular velocity, world frame (n, 3) [rad/s].
        force: of the water on the stone (n, 3) [N].
        torque: of the water about the centre of mass (n, 3) [N m].
        air_force: of the air on the stone (n, 3) [N].
        water_load: vertical force that the water was given over the step, downwards positive (n,) [N]: over
            still water all of the reaction, over waves that of the force law (docs/water.md).
        wetted_area: immersed area of the stone's surface (n,) [m^2].
        wetted_centre: centroid of that immersed surface (n, 3) [m]; the centre of mass when dry.
        clearance: height of the lowest point above the surface (n,) [m]; negative when wet.
        contacts: touches in order of time.
        skips: touches that were followed by at least `min_airtime` in the air.
        end: why it ended, one of `ENDS`.
        mass: [kg].
        attributes: provenance: scene, body, engine, integrator, timestep, throw, water, version.
        qpos: MuJoCo's coordinates (n, nq) of a model that has more joints than those of its free bodies, or of
            what floats; None otherwise; not in files.
        surface: the water as the run had it, shared by all of its stones, if it was recorded; not in files.
    """

    time: Array
    position: Array
    q: Array
    P: Array
    L: Array
    velocity: Array
    omega: Array
    force: Array
    torque: Array
    air_force: Array
    water_load: Array
    wetted_area: Array
    wetted_centre: Array
    clearance: Array
    contacts: tuple[Contact, ...]
    skips: int
    end: str
    mass: float
    attributes: dict[str, Any] = field(default_factory=dict)
    qpos: Array | None = field(default=None, compare=False, repr=False)
    surface: SurfaceRecording | None = field(default=None, compare=False, repr=False)

    def __repr__(self) -> str:
        body = self.attributes.get("body", "stone")
        skips = f"{self.skips} skip{'' if self.skips == 1 else 's'}"
        return (
            f"Trajectory({body}, {self.time[-1]:.3g} s, {len(self.time)} rows, {skips}, {self.end})"
        )

    @property
    def potential_energy(self) -> Array:
        """-m g.x (n,) [J]; gravity from the attributes, or `GRAVITY` if they do not say."""
        gravity = np.asarray(self.attributes.get("gravity", GRAVITY), dtype=np.float64)
        return -self.mass * (self.position @ gravity)

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy (n,) [J]."""
        kinetic = 0.5 * np.sum(self.P * self.velocity + self.L * self.omega, axis=1)
        return np.asarray(kinetic + self.potential_energy, dtype=np.float64)

    def to_dataset(self) -> xr.Dataset:
        """The whole trajectory as an xarray Dataset with units and provenance."""
        import xarray as xr  # half a second that few need

        variables: dict[str, Any] = {
            name: (("time", *dims), getattr(self, name), {"units": units, "long_name": text})
            for name, dims, units, text in _SERIES
        }
        for side in ("entry", "exit"):
            for name, dims, units in _MOMENT:
                gap = np.full(3, np.nan) if dims else np.nan
                rows = [getattr(getattr(c, side), name, gap) for c in self.contacts]
                shape = (len(self.contacts), 3) if dims else (len(self.contacts),)
                values = np.array(rows, dtype=np.float64).reshape(shape)
                variables[f"{side}_{name}"] = (("contact", *dims), values, {"units": units})
        for name, dims, units in _TOUCH:
            shape = (len(self.contacts), 3) if dims else (len(self.contacts),)
            values = np.array([getattr(c, name) for c in self.contacts], dtype=np.float64).reshape(
                shape
            )
            variables[f"contact_{name}"] = (("contact", *dims), values, {"units": units})
        data = xr.Dataset(
            variables,
            coords={
                "time": ("time", self.time, {"units": "s"}),
                "axis": ["x", "y", "z"],
                "part": ["w", "x", "y", "z"],
            },
        )
        data.attrs = {
            "title": "stone skipping trajectory, world frame, z up, still water at z = 0",
            "end": self.end,
            "skips": self.skips,
            "mass_kg": self.mass,
            "provenance": json.dumps(self.attributes, default=str),
        }
        return data

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a NetCDF-4 file; it appears whole or not at all.

        Args:
            path: the file.

        Raises:
            MjskipError: the folder does not exist or cannot be written to.
        """
        with whole_file(path) as part:
            # by way of memory: HDF5 itself does not survive a full disk
            part.write_bytes(self.to_dataset().to_netcdf(engine="h5netcdf"))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read what `save` wrote.

        Args:
            path: the file.

        Raises:
            MjskipError: the file is missing or is not such a file.
        """
        with reading(path, what="a trajectory", writer="`mjskip run --save` or Trajectory.save"):
            data, attrs = _contents(path)
            attributes = json.loads(attrs["provenance"])
            check_mapping("provenance", attributes, "give a JSON object")
            check_vector("gravity", attributes.get("gravity", GRAVITY), 3)
            time = data["time"]
            if not (len(time) and (np.diff(time) > 0.0).all()):
                raise ValueError("time does not increase")
            series: dict[str, Any] = {name: data[name] for name, *_ in _SERIES}
            return cls(
                time=time,
                **series,
                contacts=tuple(_contact(data, k) for k in range(len(data["entry_time"]))),
                skips=check_count("skips", attrs["skips"], low=0),
                end=str(attrs["end"]),
                mass=check_number("mass_kg", attrs["mass_kg"], low=1e-300, unit="kg"),
                attributes=attributes,
            )


def _contents(path: str | os.PathLike[str]) -> tuple[dict[str, Array], dict[str, Any]]:
    """Variables and attributes of a file that `save` wrote, each variable with the shape it should have.

    By h5py: of a damaged file xarray's reader leaves messages behind that no one can catch.
    """
    import h5py

    width = {"axis": 3, "part": 4}
    with h5py.File(path, "r") as file:
        attrs = {name: np.asarray(value)[()] for name, value in file.attrs.items()}
        attrs = {k: v.item() if np.size(v) == 1 and np.ndim(v) else v for k, v in attrs.items()}
        rows = {"time": len(file["time"]), "contact": len(file["entry_time"])}
        data = {}
        for name, dims in _shapes():
            values = file[name][()]
            if values.shape != tuple(rows.get(d) or width.get(d, 0) for d in dims):
                raise ValueError(f"{name} has shape {values.shape}")
            if values.dtype.kind != "f" or not (np.isfinite(values).all() or dims[0] == "contact"):
                raise ValueError(f"{name} holds what is no finite number")
            data[name] = values.astype(np.float64)
    return data, attrs


def _shapes() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Names and dimensions of all variables of a file."""
    yield "time", ("time",)
    yield from ((name, ("time", *dims)) for name, dims, *_ in _SERIES)
    for side in ("entry", "exit"):
        yield from ((f"{side}_{name}", ("contact", *dims)) for name, dims, _ in _MOMENT)
    yield from ((f"contact_{name}", ("contact", *dims)) for name, dims, _ in _TOUCH)


def pose_at(run: Trajectory, time: float) -> tuple[Array, Array]:
    """Centre of mass (3,) [m] and orientation (4,) between two rows; held beyond the ends."""
    after = int(np.clip(np.searchsorted(run.time, time), 1, max(len(run.time) - 1, 1)))
    if len(run.time) == 1:
        return run.position[0], run.q[0]
    earlier, later = run.time[after - 1], run.time[after]
    part = min(max((time - earlier) / (later - earlier), 0.0), 1.0) if later > earlier else 1.0
    before = run.q[after - 1]
    # q and -q are one attitude: blend the nearer pair
    beyond = run.q[after] * (1.0 if before @ run.q[after] >= 0.0 else -1.0)
    attitude = (1.0 - part) * before + part * beyond
    position = (1.0 - part) * run.position[after - 1] + part * run.position[after]
    return position, attitude / np.linalg.norm(attitude)


_SERIES: tuple[tuple[str, tuple[str, ...], str, str], ...] = (
    ("position", ("axis",), "m", "centre of mass"),
    ("q", ("part",), "1", "orientation, body to world"),
    ("P", ("axis",), "kg m s-1", "momentum"),
    ("L", ("axis",), "kg m2 s-1", "angular momentum about the centre of mass"),
    ("velocity", ("axis",), "m s-1", "velocity of the centre of mass"),
    ("omega", ("axis",), "rad s-1", "angular velocity"),
    ("force", ("axis",), "N", "force of the water on the stone"),
    ("torque", ("axis",), "N m", "torque of the water about the centre of mass"),
    ("air_force", ("axis",), "N", "force of the air on the stone"),
    ("water_load", (), "N", "vertical force given back to the water, downwards"),
    ("wetted_area", (), "m2", "immersed area of the surface"),
    ("wetted_centre", ("axis",), "m", "centroid of the immersed surface"),
    ("clearance", (), "m", "height of the lowest point above the surface"),
)
_MOMENT: tuple[tuple[str, tuple[str, ...], str], ...] = (
    ("time", (), "s"),
    ("position", ("axis",), "m"),
    ("velocity", ("axis",), "m s-1"),
    ("attack", (), "rad"),
    ("bank", (), "rad"),
    ("spin", (), "rad s-1"),
)
_TOUCH: tuple[tuple[str, tuple[str, ...], str], ...] = (
    ("depth", (), "m"),
    ("impulse", ("axis",), "N s"),
    ("airtime", (), "s"),
)


def _contact(data: Mapping[str, Array], k: int) -> Contact:
    def value(name: str) -> Any:
        return data[name][k].tolist()

    def moment(side: str) -> Moment | None:
        if math.isnan(value(f"{side}_time")):
            return None
        found: dict[str, Any] = {name: value(f"{side}_{name}") for name, *_ in _MOMENT}
        for name, number in found.items():
            found[name] = tuple(number) if isinstance(number, list) else number
        return Moment(**found)

    entry = moment("entry")
    if entry is None:
        raise ValueError(f"contact {k} has no entry")
    return Contact(
        entry=entry,
        exit=moment("exit"),
        depth=value("contact_depth"),
        impulse=tuple(value("contact_impulse")),
        airtime=value("contact_airtime"),
    )
