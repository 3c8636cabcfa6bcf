"""The best throw within what a thrower can do: for ensembles, so that it is a sure one and not a lucky one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count as count_up
from typing import Any, Literal, get_args

import numpy as np

from mjskip._typing import Array, Progress
from mjskip.checks import (
    check_choice,
    check_count,
    check_mapping,
    check_number,
    check_positive,
    check_type,
    check_vector,
    fault,
)
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.sweeps.batch import Outcomes, throw_all
from mjskip.sweeps.design import MAX_THROWS, normal
from mjskip.throws.recording import Limits
from mjskip.throws.throw import PARAMETERS, Throw

Goal = Literal["skips", "distance"]
GOALS: tuple[Goal, ...] = get_args(Goal)

HAND: dict[str, float] = {
    "speed": 0.3,
    "spin": 3.0,
    "attack": 0.035,
    "descent": 0.018,
    "bank": 0.035,
}
"""Standard deviations of a practised hand, assumed: 0.3 m/s, 0.5 rev/s, 2, 1 and 2 degrees (SI here)."""

NEIGHBOURS = 9
"""Values of each parameter that the neighbourhood looks at, over its whole range."""

MAX_COUNT = 10**6
"""Members, candidates and generations at most, each."""

GOOD_FRACTION = 0.9
"""Part of the best mean that still counts as good in the neighbourhood."""


@dataclass(frozen=True, kw_only=True)
class Neighbourhood:
    """What becomes of the best throw if one parameter is another.

    Attributes:
        values: of the parameter (n,), ascending, SI.
        mean: of the goal over the ensemble (n,).
        deviation: of the goal within the ensemble (n,).
        good: lowest and highest value around the best one at which the mean is at least `GOOD_FRACTION` of it.
    """

    values: Array
    mean: Array
    deviation: Array
    good: tuple[float, float]


@dataclass(frozen=True, kw_only=True, repr=False)
class Best:
    """The best throw found.

    Attributes:
        throw: the throw to aim for.
        goal: "skips" or "distance" [m].
        mean: of the goal over an ensemble that the search never saw.
        deviation: standard deviation within it.
        tenth: one throw in ten does no better than this.
        aimed: the goal if the hand does exactly what it aims for.
        searched: mean that the search saw: above `mean` by its luck.
        neighbourhood: by parameter.
        throws: how many were thrown to find it.
    """

    throw: Throw
    goal: Goal
    mean: float
    deviation: float
    tenth: float
    aimed: float
    searched: float
    neighbourhood: Mapping[str, Neighbourhood]
    throws: int

    def __repr__(self) -> str:
        return f"Best({self.throw}, {self.goal} {self.mean:.3g} on average)"


# Over 80 lines: checks of eleven options, then one search whose state is local to it.
def optimize(
    stone: Stone,
    ranges: Mapping[str, tuple[float, float]],
    *,
    goal: Goal = "skips",
    throw: Throw | None = None,
    water: Water | None = None,
    scatter: Mapping[str, float] | None = None,
    members: int = 32,
    population: int = 24,
    generations: int = 20,
    timestep: float = 5e-4,
    limits: Limits | None = None,
    threads: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Best:
    """The throw with most skips or the longest way, within a thrower's ranges.

    Every candidate is an ensemble of throws around what is aimed for, the same scatter for all. SciPy's
    differential evolution maximises its mean; of candidates with equal skips the one that gets farther is
    preferred. The winner is then thrown anew with other scatter, four times as often: that is what is
    reported.

    Args:
        stone: the body.
        ranges: lowest and highest value by parameter of the throw, SI: what the thrower can do.
        goal: "skips" or "distance".
        throw: what is not in `ranges`.
        water: the fluid.
        scatter: standard deviation of the hand by parameter; `HAND` if None, {} for a perfect one.
        members: of an ensemble.
        population: candidates in a generation.
        generations: at most.
        timestep: [s].
        limits: what counts as a skip and when a throw is over.
        threads: that share the work.
        seed: of search and scatter.
        progress: called with the generations done and to do.

    Raises:
        ValueError: a range is not of a throw or has its ends the wrong way round, or no throw within the
            ranges can be made.
    """
    check_type("stone", stone, Stone)
    base = Throw() if throw is None else check_type("throw", throw, Throw)
    for name, given, kind in (("water", water, Water), ("limits", limits, Limits)):
        if given is not None:
            check_type(name, given, kind)
    check_positive(timestep=timestep)
    if threads is not None:
        check_count("threads", threads)
    ranges = _checked_ranges(ranges, base)
    spread = _checked_scatter(HAND if scatter is None else scatter)
    check_choice("goal", goal, GOALS)
    members = check_count("members", members, high=MAX_COUNT)
    population = check_count("population", population, high=MAX_COUNT)
    generations = check_count("generations", generations, high=MAX_COUNT)
    seed = check_count("seed", seed, low=0)
    names = list(ranges)
    each = max(1, -(-population // len(names)))  # candidates by parameter, as SciPy counts
    thrown = each * len(names) * members * (generations + 1)
    if thrown > MAX_THROWS:
        raise ValueError(
            f"the search has {thrown} throws ({each * len(names)} candidates of {members} members in "
            f"{generations} generations and a first one): at most {MAX_THROWS} are allowed"
        )

    def throw_them(throws: list[Throw]) -> Outcomes:
        return throw_all(
            stone, throws, water=water, timestep=timestep, limits=limits, threads=threads
        )

    ensembles = _Ensembles(names, base, goal, throw_them)
    searched = _scatter_of(spread, members, seed)

    def cost(columns: Array) -> Array:
        """Minus the mean; a metre counts for a thousandth of a skip."""
        found, distance = ensembles(columns.T, searched, members)
        return np.asarray(-found.mean(axis=1) - 1e-3 * distance.mean(axis=1) * (goal == "skips"))

    done = count_up(1)

    def generation_done(*_: Any) -> None:
        number = next(done)
        if progress:
            progress(min(number, generations), generations)

    from scipy.optimize import differential_evolution

    search: Any = differential_evolution  # its stubs know no vectorized=True
    found = search(
        cost, [ranges[n] for n in names], maxiter=generations, init="latinhypercube",
        popsize=each, vectorized=True, updating="deferred",
        polish=False, tol=1e-3, rng=np.random.default_rng(seed), callback=generation_done,
    )  # fmt: skip
    aim = np.asarray(found.x, dtype=np.float64)
    fresh = _scatter_of(spread, 4 * members, seed + 1)
    values = ensembles(aim[None], fresh, 4 * members)[0][0]
    return Best(
        throw=replace(base, **dict(zip(names, map(float, aim), strict=True))),
        goal=goal,
        mean=float(values.mean()),
        deviation=float(values.std()),
        tenth=float(np.quantile(values, 0.1)),
        aimed=float(ensembles(aim[None], {}, 1)[0][0, 0]),
        searched=float(ensembles(aim[None], searched, members)[0].mean()),
        neighbourhood={
            name: _around(k, aim, ranges[name], lambda c: ensembles(c, fresh, 4 * members)[0])
            for k, name in enumerate(names)
        },
        throws=ensembles.thrown,
    )


class _Ensembles:
    """Throws around candidates.

    Attributes:
        thrown: how many until now.
    """

    def __init__(
        self,
        names: list[str],
        base: Throw,
        goal: Goal,
        throw_them: Callable[[list[Throw]], Outcomes],
    ) -> None:
        """Candidates are values of the parameters `names`; `base` has the others."""
        self._names, self._base, self._goal, self._throw_them = names, base, goal, throw_them
        self.thrown = 0

    def __call__(
        self, candidates: Array, scatter: Mapping[str, Array], count: int
    ) -> tuple[Array, Array]:
        """Goal and distance of every member of every candidate: (candidates, count) each.

        Args:
            candidates: (n, parameters).
            scatter: additions by parameter (count,) each.
            count: members of an ensemble.
        """
        throws = []
        for candidate in candidates:
            aimed = replace(
                self._base, **dict(zip(self._names, map(float, candidate), strict=True))
            )
            for m in range(count):
                strayed = {n: getattr(aimed, n) + float(scatter[n][m]) for n in scatter}
                throws.append(replace(aimed, **_within(strayed)))
        self.thrown += len(throws)
        done = self._throw_them(throws)
        lost = done.end == "diverged"
        distance = np.where(lost, 0.0, done.distance).reshape(len(candidates), count)
        skips = np.where(lost, 0, done.skips).reshape(len(candidates), count)
        return (skips.astype(np.float64) if self._goal == "skips" else distance), distance


def _around(
    k: int, aim: Array, ends: tuple[float, float], ensembles: Callable[[Array], Array]
) -> Neighbourhood:
    """Vary coordinate k of the best throw over its range, the best value among them."""
    values = np.unique(np.append(np.linspace(*ends, NEIGHBOURS - 1), aim[k]))
    candidates = np.repeat(aim[None], len(values), axis=0)
    candidates[:, k] = values
    found = ensembles(candidates)
    mean = found.mean(axis=1)
    here = int(np.argmin(abs(values - aim[k])))
    first = last = here
    while first > 0 and mean[first - 1] >= GOOD_FRACTION * mean[here]:
        first -= 1
    while last < len(values) - 1 and mean[last + 1] >= GOOD_FRACTION * mean[here]:
        last += 1
    return Neighbourhood(
        values=values,
        mean=mean,
        deviation=found.std(axis=1),
        good=(float(values[first]), float(values[last])),
    )


def _scatter_of(spread: Mapping[str, float], count: int, seed: int) -> dict[str, Array]:
    """What the hand adds to each parameter, (count,) each."""
    if not spread:
        return {}
    return normal({name: (0.0, sd) for name, sd in spread.items()}, count=count, seed=seed)


def _within(made: dict[str, float]) -> dict[str, float]:
    """What leaves the hand, kept to what a `Throw` can be: a speed scattered below 0 is 0."""
    lowest = {"speed": 0.0, "height": 0.0}
    return {name: max(value, lowest.get(name, value)) for name, value in made.items()}


def _checked_ranges(given: object, base: Throw) -> dict[str, tuple[float, float]]:
    ranges = check_mapping(
        "ranges", given, "give what the thrower can do, such as {'speed': (5, 12)}"
    )
    if not ranges:
        raise fault("ranges", given, "say what the thrower can do, such as {'speed': (5, 12)}")
    found = {}
    for name, ends in ranges.items():
        check_choice("a parameter of ranges", name, tuple(PARAMETERS))
        low, high = check_vector(name, ends, 2).tolist()
        if not low < high:
            raise ValueError(f"{name} from {low!r} to {high!r}: give the lower end first")
        for end in (low, high):
            replace(base, **{name: end})  # says what is out of range
        found[name] = (low, high)
    return found


def _checked_scatter(given: object) -> dict[str, float]:
    scatter = check_mapping("scatter", given, "give standard deviations by parameter")
    for name, deviation in scatter.items():
        check_choice("a parameter of scatter", name, tuple(PARAMETERS))
        check_number(name, deviation, low=0.0)
    return dict(scatter)
