"""hypothesis strategies for cases of every kind; a case is JSON."""

import base64
import re
import tempfile
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

import mjskip
from tests.fuzz.worker import SPECIAL

MODELS = Path(__file__).parents[2] / "models"

odd_numbers = st.one_of(
    st.floats(-1e3, 1e3),
    st.sampled_from([0, -1, 1e-300, 1e300, 1e9, -1e9, 2**63, 1e-12]),
    st.sampled_from(["<nan>", "<inf>"]),
)
odd_values = st.one_of(
    odd_numbers,
    st.sampled_from(
        [*SPECIAL, "", "x", "12", True, False, None, [], [1, 2, 3], {}, "../..", "boat"]
    ),
)


# Scenes: shipped ones with a number, a name or an element changed --------------------------------


@cache
def scene_texts():
    return [path.read_text() for path in sorted(MODELS.glob("*.xml"))]


NUMBER = re.compile(r'(?<=[" ])-?\d*\.?\d+(?:e-?\d+)?(?=[" ])')
ELEMENT = re.compile(r"<(geom|body|joint|freejoint|camera|light|text|numeric|site)\b[^>]*/>")


@st.composite
def scenes(draw):
    """A shipped scene with one to three changes, so that most still load."""
    text = draw(st.sampled_from(scene_texts()))
    text = text.replace('<include file="', f'<include file="{MODELS}/')
    text = text.replace('meshdir="', f'meshdir="{MODELS}/')
    for _ in range(draw(st.integers(1, 3))):
        change = draw(st.sampled_from(["number", "number", "number", "drop", "double", "cut"]))
        if change == "number":
            places = list(NUMBER.finditer(text))
            if not places:
                continue
            at = places[draw(st.integers(0, len(places) - 1))]
            new = draw(
                st.sampled_from(
                    ["0", "-1", "1e9", "1e-9", "nan", "inf", "1e300", "", "x", "0.5", "3"]
                )
            )
            text = text[: at.start()] + new + text[at.end() :]
        elif change in ("drop", "double"):
            places = list(ELEMENT.finditer(text))
            if places:
                at = places[draw(st.integers(0, len(places) - 1))]
                text = (
                    text[: at.start()]
                    + (at[0] * 2 if change == "double" else "")
                    + text[at.end() :]
                )
        else:
            text = text[: draw(st.integers(0, len(text)))] if draw(st.booleans()) else text
    return {"kind": "scene", "xml": text}


# Command lines -----------------------------------------------------------------------------------

OPTIONS = (
    "--speed", "--spin", "--attack", "--descent", "--bank", "--height", "--law", "--surface", "--engine",
    "--integrator", "--timestep", "--body", "--json", "--duration", "--gate", "--buoyancy", "--help",
)  # fmt: skip
WORDS = (
    "lake",
    "duel",
    "nothing.xml",
    "",
    "-1",
    "0",
    "nan",
    "1e9",
    "12",
    "still",
    "waves",
    "x=1:2",
    "rk4",
)


@st.composite
def arguments(draw):
    """Words for `mjskip`, short runs among them."""
    command = draw(
        st.sampled_from(["run", "run", "compare", "sweep", "optimize", "plot", "info", "nope"])
    )
    words = draw(st.lists(st.sampled_from([*OPTIONS, *WORDS]), max_size=5))
    quick = ["--duration", "0.05"] if command == "run" else []
    return {"kind": "arguments", "words": [command, *quick, *words]}


# Calls -------------------------------------------------------------------------------------------


@st.composite
def calls(draw):
    """A public function with one to three odd arguments."""
    from tests.fuzz import calls as callables

    everything = callables.calls()
    name = draw(st.sampled_from(sorted(everything)))
    parameters = everything[name][2]
    if not parameters:
        return {"kind": "call", "name": name, "arguments": {}}
    some = draw(st.lists(st.sampled_from(parameters), min_size=1, max_size=3, unique=True))
    return {"kind": "call", "name": name, "arguments": {k: draw(odd_values) for k in some}}


# Files -------------------------------------------------------------------------------------------


@cache
def sound_files():
    """Bytes of a trajectory and of a surface."""
    with tempfile.TemporaryDirectory() as folder:
        run, field = Path(folder, "run.nc"), Path(folder, "field.npz")
        mjskip.integrate(
            mjskip.Stone.pebble(), mjskip.Throw(), limits=mjskip.Limits(duration=0.25)
        ).save(run)
        mjskip.HeightField((8, 8)).save(field)
        return {".nc": run.read_bytes(), ".npz": field.read_bytes()}


@st.composite
def files(draw):
    """A file of results, cut off or with some bytes changed."""
    suffix = draw(st.sampled_from([".nc", ".npz"]))
    content = bytearray(sound_files()[suffix])
    if draw(st.booleans()):
        content = content[: draw(st.integers(0, len(content)))]
    for _ in range(draw(st.integers(0, 8)) if content else 0):
        content[draw(st.integers(0, len(content) - 1))] = draw(st.integers(0, 255))
    return {"kind": "file", "suffix": suffix, "content": base64.b64encode(content).decode()}


# Links -------------------------------------------------------------------------------------------

links = st.one_of(
    st.text(max_size=60),
    st.lists(
        st.tuples(
            st.sampled_from(["speed", "spin", "attack", "law", "stone", "surface", "radius", "x"]),
            st.sampled_from(["12", "-1", "nan", "1e999", "", "lee2010", "scene", "%00", "é"]),
        ),
        max_size=5,
    ).map(lambda pairs: "&".join(f"{name}={value}" for name, value in pairs)),
).map(lambda query: {"kind": "link", "query": query})

KINDS = {
    "scene": scenes(),
    "arguments": arguments(),
    "call": calls(),
    "file": files(),
    "link": links,
}
