"""Ctrl-C at any moment from the first line on: code 130, one line at most, nothing left behind."""

import signal
import subprocess
import sys
import time

import pytest


@pytest.mark.parametrize("delay", [0.15, 0.4, 0.8, 1.6, 3.0])
def test_an_interrupt_is_quiet_prompt_and_leaves_no_part_of_a_file(tmp_path, delay):
    start = "import mjskip.__main__ as m; print(1, flush=True); m.main()"
    process = subprocess.Popen(
        [sys.executable, "-c", start, "run", "--video", "throw.mp4"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    process.stdout.readline()
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    asked = time.monotonic()
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert time.monotonic() - asked < 20.0
    assert [line for line in errors.splitlines() if line.startswith("mjskip: ")] == [
        "mjskip: interrupted"
    ]
    assert "Traceback" not in errors
    assert "Exception ignored" not in errors
    assert not list(tmp_path.iterdir())
