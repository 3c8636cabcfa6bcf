"""Does it matter that the water gives way? Clanet's disc over deep water that moves, beside still water.

The implicit coupling of the reference engine (window of deep water, cells of 1 cm, loads spread over 2 cm).
Contact ends when no face is loaded. 30 s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from _common import clanet_disc, contact_time, first, in_parallel, leaves, main, table, threshold

from mjskip import Throw, Water
from mjskip.throws.two_way import TwoWayIntegrator
from mjskip.waves.window import Window

TITLE = "Over deep water that moves"

LAWS = ("lee2010", "rosellini2005_forward", "rayleigh1876_forward")
STEP = 4e-4


def over_deep_water(
    law: str, *, speed: float = 3.5, spin: float = 65.0, attack: float = 20.0, descent: float = 20.0
) -> tuple[float, float] | None:
    """Contact time [s] and vertical exit speed [m/s]; None if the disc stays in for 0.1 s."""
    disc = clanet_disc(segments=32)
    throw = Throw.from_degrees(speed=speed, spin=spin, attack=attack, descent=descent, height=0.0)
    run = TwoWayIntegrator(
        [disc], [throw.state(disc)], window=Window("deep"),
        water=Water(law=law, air_density=0.0), timestep=STEP, exact=False,
    )  # fmt: skip
    last = None
    while run.time < 0.1 and run.states[0, 2] > -0.08:
        run.step()
        if run.loads is not None and run.loads.loads.any():
            last = run.time
        elif last is not None and run.time - last > 2e-3:
            return last, float(run.states[0, 14])
    return None


def law_row(law: str) -> dict[str, Any]:
    """The measured cases by one law, over both waters."""
    disc = clanet_disc()
    still: dict[str, Any] = {"law": law, "timestep": 2e-4}
    reference = over_deep_water(law)
    return {
        "law": law,
        "still_tau_ms": 1e3 * contact_time(first(disc, **still)),
        "tau_ms": None if reference is None else 1e3 * reference[0],
        "still_slowest": threshold(lambda u: leaves(disc, speed=u, **still), 1.5, 5.0, steps=6),
        "slowest": threshold(
            lambda u: over_deep_water(law, speed=u) is not None, 1.5, 5.0, steps=6
        ),
        "trout": over_deep_water(law, spin=10.0) is not None,
        "dive": over_deep_water(law, spin=0.0, attack=35.0) is None,
        "surf": over_deep_water(law, attack=30.0, descent=35.0) is None,
    }


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """All rows; short and full form are the same."""
    return {"laws": {row["law"]: row for row in in_parallel(law_row, LAWS)}}


def page(found: dict[str, Any]) -> str:
    laws = found["laws"]

    def each(make: Any) -> list[Any]:
        return [make(laws[law]) for law in LAWS]

    def both(still: str, deep: str) -> list[str]:
        def one(value: float | None) -> str:
            return "stays in" if value is None else f"{value:.3g}"

        return each(lambda r: f"{one(r[still])} → {one(r[deep])}")

    rows = [
        ("contact at 65 rev/s [ms]", "32", *both("still_tau_ms", "tau_ms")),
        ("slowest speed (deep: to 0.1) [m/s]", "2.5–2.6", *both("still_slowest", "slowest")),
        ("surf: 30/35", "never leaves", *each(lambda r: "stays in" if r["surf"] else "**leaves**")),
    ]  # fmt: skip
    return (
        table(("quantity (still → deep)", "measured", *LAWS), rows)
        + "\n\nWater that gives way takes part of the load: contacts lengthen. Faces are loaded there while they "
        "advance against the moving surface (gate `local`). Bumps of 1 to 3 cm that spread the load and half the step "
        "move the reference contact by some 2 ms."
    )


if __name__ == "__main__":
    main(run, page)
