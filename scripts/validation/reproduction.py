"""The paper's claims, one row each: what we used, what we found, and whether it holds."""

from __future__ import annotations

from typing import Any

from _common import table

TITLE = "The paper, claim by claim"


def summary(found: dict[str, Any]) -> str:
    """The first lines of the page."""
    oracle, laws = found["oracle"], found["experiments"]["laws"]
    lee, rayleigh = laws["lee2010"], laws["rayleigh1876_forward"]
    orders = {(o["engine"], o["integrator"]): o for o in found["convergence"]["compare"]["orders"]}
    agree = found["convergence"]["compare"]["agreement"][-1]
    failed = "" if oracle["passed"] == oracle["total"] else " **Not all.**"
    lines = [
        f"**Computed right: yes.** {oracle['passed']} of {oracle['total']} oracle rows agree "
        f"within their tolerances.{failed} MuJoCo and the pure integrator agree to "
        f"{agree['touch_position']:.0e} m through a touch; RK4 converges with order "
        f"{orders['mujoco', 'RK4']['smooth_flight']:.1f} in smooth flight.",
        f"**The right physics: in part.** The paper's law needs {lee['slowest']['20']:.2f} m/s and "
        f"{lee['least_spin']:.0f} rev/s where the real disc bounces at 2.5 to 2.6 m/s; "
        f"`rayleigh1876_forward` gives {rayleigh['slowest']['20']:.2f} m/s and a contact of "
        f"{rayleigh['tau_ms']:.1f} ms (measured 32), the trout and the dive, not the surf.",
        "**The paper: its claims about spin hold** for thin stones as a threshold and for round ones as a "
        "gain; its numbers cannot be told, as it gives neither stone nor step. The table below goes claim by "
        "claim.",
    ]
    return "\n".join(f"- {line}" for line in lines)


def _series(found: dict[str, Any], stone: str, speed: float) -> dict[float, tuple[float, float]]:
    one = next(
        s for s in found["fig_spin"]["series"] if s["stone"] == stone and s["speed"] == speed
    )
    return {
        spin: (mean, std)
        for spin, mean, std in zip(one["spin"], one["mean"], one["std"], strict=True)
    }


def _pm(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.1f} ± {pair[1]:.1f}"


def _ring(found: dict[str, Any], stencil: str, cells: int) -> float:
    return next(
        r["apart"]
        for r in found["fig_rings"]["rows"]
        if (r["stencil"], r["cells"]) == (stencil, cells)
    )


def claims(found: dict[str, Any]) -> list[tuple[str, str, str, str, str]]:
    """Claim, what we used, what we found, verdict, why."""
    flat, round_ = _series(found, "flat", 8.0), _series(found, "round", 8.0)
    flat12, round12 = _series(found, "flat", 12.0), _series(found, "round", 12.0)
    momentum = {(s["stone"], bool(s["spin"])): s for s in found["fig_momentum"]["series"]}
    paths = {r["spin"]: r for r in found["fig_paths"]["rows"]}
    left, none = paths[300.0], paths[0.0]
    waves, lee = found["waves"], found["experiments"]["laws"]["lee2010"]
    best = min((u, a) for a, u in lee["slowest"].items() if u is not None)[1]
    step = found["timestep"]
    performance = found["performance"]
    per_vertex = [
        1e9 * seconds / side**2
        for side, seconds in zip(performance["sides"], performance["side_seconds"], strict=True)
    ]
    return [
        (
            "Fig 5 (waves): rings of (7) are diamond-ish, of (8) rounder",
            "rings of 6 and 12 cells wavelength, radius of a crest on the diagonal against the axis",
            f"(7) {_ring(found, 'five_point', 6):+.1f}% and {_ring(found, 'five_point', 12):+.1f}%; "
            f"(8) repaired {_ring(found, 'nine_point', 6):+.2f}% and "
            f"{_ring(found, 'nine_point', 12):+.2f}%",
            "holds, repaired",
            f"as printed, (8) makes a metre of a millimetre in {waves['printed']['steps']} steps",
        ),
        (
            "Bound (9) keeps the water stable",
            "stencil (7), μt = 0.2, 99% of (9)",
            f"a metre from a millimetre in {waves['bound_9']['steps_to_a_metre']} steps",
            "does not hold",
            f"it allows {waves['bound_9']['paper_limit_over_exact']:.3f} of the von Neumann limit",
        ),
        (
            "Fig 4, 6: a throw skips over moving water",
            "lake scene, pebble of 44 triangles",
            f"{found['fig_strip']['skips']} skips over {found['fig_strip']['distance']:.1f} m, drawn",
            "holds",
            "stone, throw and step of the paper are not given: the picture is alike, not the same",
        ),
        (
            "Fig 5 (throws): with spin the path bends, without it is straight",
            f"flat stone, {found['fig_paths']['speed']:.0f} m/s, 300 rad/s; "
            f"{found['fig_paths']['throws']} throws",
            f"{100 * left['sideways_mean']:+.0f} ± {100 * left['sideways_std']:.0f} cm at the end against "
            f"{100 * none['sideways_mean']:+.0f} ± {100 * none['sideways_std']:.0f} cm",
            "holds",
            "the load's torque turns a spinning disc about its heading: it leans, and lift has a side",
        ),
        (
            "Fig 5 (throws): spin gives more skips",
            "the same throws",
            f"{left['skips_mean']:.1f} ± {left['skips_std']:.1f} against "
            f"{none['skips_mean']:.1f} ± {none['skips_std']:.1f}",
            "holds",
            "without spin a flat stone turns nose down in its first touch",
        ),
        (
            "Fig 7: large difference in skips between no spin and some",
            f"{found['fig_spin']['throws']} throws a point, flat and round, 8 and 12 m/s",
            f"flat {_pm(flat[0.0])} → {_pm(flat[400.0])} at 400 rad/s (12 m/s: {_pm(flat12[0.0])} → "
            f"{_pm(flat12[400.0])}); round {_pm(round_[0.0])} → {_pm(round_[400.0])} (12 m/s: "
            f"{_pm(round12[0.0])} → {_pm(round12[400.0])})",
            "holds where the stone is flat",
            "flat: a threshold, then a staircase; round: no threshold, a gain by a factor",
        ),
        (
            "Fig 8: 8 m/s without spin, 3 skips and a sharp drop",
            "flat and round, no spin",
            f"flat {momentum['flat', False]['skips_mean']:.1f} skips, "
            f"{100 * momentum['flat', False]['drop']:.0f}% lost within 50 ms; round "
            f"{momentum['round', False]['skips_mean']:.1f} ± {momentum['round', False]['skips_std']:.1f}, "
            f"{100 * momentum['round', False]['drop']:.0f}%",
            "holds where the stone is round",
            "the drop holds for both; skips without spin only for a pebble that has no face to turn down",
        ),
        (
            "Fig 8: with spin a gentle drop and more skips",
            "the same, 400 rad/s",
            f"flat {momentum['flat', True]['skips_mean']:.1f} ± "
            f"{momentum['flat', True]['skips_std']:.1f}, {100 * momentum['flat', True]['drop']:.0f}%; round "
            f"{momentum['round', True]['skips_mean']:.1f} ± {momentum['round', True]['skips_std']:.1f}, "
            f"{100 * momentum['round', True]['drop']:.0f}%",
            "holds",
            "spin keeps the attitude, so that each touch takes a small share",
        ),
        (
            "Section 2: an attack of about 20° is best",
            "slowest bouncing speed over attack, Clanet's disc, 65 rev/s, `lee2010`",
            f"least speed at {best}°",
            "holds" if best == "20" else "does not hold",
            f"measured: 20°; the paper's law puts it at {best}° (see the laws)",
        ),
        (
            "Section 2: faster throws skip more",
            "flat stone at 800 rad/s, round pebble at 400, 8 → 12 m/s",
            f"flat {_pm(flat[800.0])} → {_pm(flat12[800.0])}, round {_pm(round_[400.0])} → "
            f"{_pm(round12[400.0])}",
            "holds" if flat12[800.0][0] > flat[800.0][0] and round12[400.0][0] > round_[400.0][0]
            else "does not hold",
            "less momentum is lost per touch and gravity has less time",
        ),
        (
            "Section 5: 44 triangles + 500 × 500 water vertices, above 90 frames/s",
            performance["setup"],
            f"{performance['frames_per_second']:.0f} frames/s; {performance['shares']}",
            "cannot be told"
            if performance["load"] > performance["processors"]
            else ("holds" if performance["frames_per_second"] > 90 else "does not hold here"),
            f"{performance['why']}; load {performance['load']:.1f} on {performance['processors']} processors",
        ),
        (
            "Section 6: cost grows with the square of the water's side",
            "water step alone, sides of " + ", ".join(str(n) for n in performance["sides"]),
            ", ".join(f"{ns:.2f}" for ns in per_vertex) + " ns a vertex",
            "holds" if max(per_vertex) < 1.25 * min(per_vertex) else "holds roughly",
            "every vertex is visited, but what one costs depends on overhead (small) and on caches (large)",
        ),
        (
            "Real time: the stone advances by frames (step not given)",
            "semi-implicit Euler at 1/60 s, frozen attitude, Clanet's touch",
            f"leaves at {step['coarse']['vz']:.1f} m/s instead of {step['fine']['vz']:.2f}",
            "cannot be told",
            f"a step of a frame is wrong by a factor of {step['factor']:.0f}; the paper does not say its step",
        ),
        (
            "Sizes of stone, mass, attack, height, step",
            "–",
            "not in the paper",
            "cannot be told",
            "so its absolute numbers of skips can be neither met nor missed",
        ),
    ]  # fmt: skip


def page(found: dict[str, Any]) -> str:
    return table(("claim", "what we used", "what we found", "verdict", "why"), claims(found))
