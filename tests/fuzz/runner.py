"""Runs cases in a worker process that is started again when one kills it or takes too long."""

import json
import select
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PATIENCE = 300.0
"""Longest time for one case [s]; the first compiles."""


class Runner:
    """One worker process; use it with `with`."""

    def __init__(self):
        self._process = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stop()

    def __call__(self, case):
        """The verdict of a case: outcome result, line, wrong, crash or timeout, and why."""
        if self._process is None:
            command = [sys.executable, "-m", "tests.fuzz.worker"]
            self._process = subprocess.Popen(
                command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
        try:
            self._process.stdin.write(json.dumps(case) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass
        ready, _, _ = select.select([self._process.stdout], [], [], PATIENCE)
        answer = self._process.stdout.readline() if ready else ""
        if answer:
            return json.loads(answer)
        code = self._process.poll() if not ready else self._process.wait()
        self._stop()
        if not ready:
            return {"outcome": "timeout", "why": f"no answer in {PATIENCE:g} s"}
        return {"outcome": "crash", "why": f"the process ended with code {code}"}

    def _stop(self):
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def is_right(verdict):
    """Whether a case ended as every case must: in a result or in one line."""
    return verdict["outcome"] in ("result", "line")
