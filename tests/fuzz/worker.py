"""A process that runs fuzz cases: one JSON case a line on standard input, one JSON verdict a line back.

Run as `python -m tests.fuzz.worker`. A case that kills the process is seen by whoever started it.
"""

import base64
import contextlib
import io
import json
import math
import os
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import mjskip
from mjskip.errors import MjskipError

SPECIAL = {
    "<nan>": math.nan,
    "<inf>": math.inf,
    "<object>": object(),
    "<complex>": 1 + 2j,
    "<array>": np.arange(3.0),
    "<nan array>": np.full(3, np.nan),
    "<bytes>": b"\x00\xff",
    "<dict>": {"speed": 3},
    "<class>": dict,
}
"""Values that JSON cannot carry, by the text that stands for them."""


def run_scene(case):
    """Load a scene; throw or simulate it for a moment."""
    path = Path("scene.xml")
    path.write_text(case["xml"], encoding="utf-8")
    scene = mjskip.load_scene(path)
    mjskip.simulate(scene, limits=mjskip.Limits(duration=0.02))


def run_arguments(case):
    """A command line; its exit code and what it printed must fit together."""
    from mjskip.cli import main

    out, err = io.StringIO(), io.StringIO()
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(case["words"])
        except SystemExit as ended:
            code = ended.code or 0
    if code not in (0, 1, 2):
        raise AssertionError(f"exit code {code!r}")
    lines = [line for line in err.getvalue().splitlines() if line.startswith("mjskip: ")]
    if code and (not lines or "Traceback" in err.getvalue()):
        raise AssertionError(f"code {code} and standard error {err.getvalue()[-300:]!r}")


def run_call(case):
    """A public function with unfit arguments."""
    from tests.fuzz.calls import calls

    function, fit, _ = calls()[case["name"]]
    function(**{**fit, **{name: _value(value) for name, value in case["arguments"].items()}})


def _value(value):
    return SPECIAL.get(value, value) if isinstance(value, str) else value


def run_file(case):
    """A damaged file of results."""
    path = Path("damaged" + case["suffix"])
    path.write_bytes(base64.b64decode(case["content"]))
    reader = {".nc": mjskip.Trajectory.load, ".npz": mjskip.HeightField.load}[case["suffix"]]
    reader(path)


def run_link(case):
    """A link of the playground."""
    from mjskip.play.settings import Settings

    Settings.of_scene(mjskip.load_scene("lake")).read_link(case["query"])


KINDS = {
    "scene": run_scene,
    "arguments": run_arguments,
    "call": run_call,
    "file": run_file,
    "link": run_link,
}


def verdict(case):
    """ "result", "line", or "wrong" with the reason."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            KINDS[case["kind"]](case)
    except (MjskipError, ValueError) as error:
        text = str(error)
        if not text.strip() or len(text.strip().splitlines()) > 1:
            return {
                "outcome": "wrong",
                "why": f"{type(error).__name__} of several lines: {text[:300]}",
            }
        return {"outcome": "line", "why": text[:300]}
    except BaseException as error:
        return {"outcome": "wrong", "why": f"{type(error).__name__}: {str(error)[:300]}"}
    return {"outcome": "result", "why": ""}


def main():
    """Answer until standard input ends."""
    answers = os.fdopen(os.dup(1), "w")  # what the cases print must not get between
    os.dup2(2, 1)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for line in sys.stdin:
            answer = verdict(json.loads(line))
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
