"""What bodies that radiate cost a step, beside the same model without water.

    python scripts/bench_afloat.py [FILE.json]       # some 30 s

Processor time per `mj_step` [us], least of five interleaved rounds: MuJoCo alone, still water that bears, radiation in calm
water, in a regular and in an irregular sea; one sphere, one barge, one boat of a mesh, ten spheres.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import mujoco

import mjskip
from mjskip.coupling.loading import load_model
from mjskip.coupling.plugin import plugin_surface, register_plugin
from mjskip.throws.scene import shipped_scenes

SPHERE = '<body name="s{n}" pos="{x} {y} 0"><freejoint/><geom type="sphere" size=".15" mass="7.0686"/>{plugin}</body>'
BARGE = '<body name="barge"><freejoint/><geom type="box" size=".5 .2 .1" mass="40"/>{plugin}</body>'
CARRIES = '<plugin instance="sea"/>'
WATERS = {
    "alone": None,
    "bearing": "",
    "calm": '<config key="radiation" value="true"/>',
    "regular": '<config key="radiation" value="true"/><config key="sea" value="height=0.05 period=1.5"/>',
    "irregular": '<config key="radiation" value="true"/><config key="sea" value="hs=0.05 tp=1.5"/>',
}


def compiled(bodies: str, words: str | None) -> mujoco.MjModel:
    """The bodies with one of the waters."""
    plugin = "" if words is None else CARRIES
    extension = "" if words is None else (
        '<extension><plugin plugin="mjskip.water"><instance name="sea"><config key="preset" value="floating"/>'
        f"{words}</instance></plugin></extension>"
    )  # fmt: skip
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.002" integrator="implicitfast"/>{extension}<worldbody>'
        f"{bodies.replace('{plugin}', plugin)}</worldbody></mujoco>"
    )


def main() -> None:
    register_plugin()
    ten = "".join(
        SPHERE.replace("{n}", str(n))
        .replace("{x}", str(0.6 * (n % 5)))
        .replace("{y}", str(0.6 * (n // 5)))
        for n in range(10)
    )
    one = SPHERE.replace("{n}", "0").replace("{x}", "0").replace("{y}", "0")
    found: dict[str, dict[str, float]] = {"made by": mjskip.__version__}  # type: ignore[dict-item]
    for name, bodies in (("sphere", one), ("barge", BARGE), ("ten spheres", ten)):
        models = {water: compiled(bodies, words) for water, words in WATERS.items()}
        datas = {water: mujoco.MjData(model) for water, model in models.items()}
        best = dict.fromkeys(WATERS, float("inf"))
        count = 400 if name != "ten spheres" else 100
        for _ in range(5):
            for water, model in models.items():
                start = time.process_time()
                for _ in range(count):
                    mujoco.mj_step(model, datas[water])
                best[water] = min(best[water], 1e6 * (time.process_time() - start) / count)
        waves = plugin_surface(models["calm"]).modes.size
        found[name] = {**{k: round(v, 1) for k, v in best.items()}, "plane waves": waves}
        print(name, found[name])
    model = load_model(shipped_scenes()["boat_in_swell"])
    data, start = mujoco.MjData(model), time.process_time()
    for _ in range(1000):
        mujoco.mj_step(model, data)
    found["boat_in_swell"] = {"irregular": round(1e3 * (time.process_time() - start), 1)}
    print("boat_in_swell", found["boat_in_swell"])
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
