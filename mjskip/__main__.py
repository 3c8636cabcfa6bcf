"""The command `mjskip`, and python -m mjskip: quiet and prompt when interrupted, imports included."""

import os
import signal
from types import FrameType

INTERRUPTED = 130

_interrupts: list[int] = []


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; in the midst of an import, which would make other errors of it, end at once."""
    _interrupts.append(number)
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            os.write(2, b"mjskip: interrupted\n")
            os._exit(INTERRUPTED)
        frame = frame.f_back
    raise KeyboardInterrupt


def main() -> None:
    """Run a command and exit: 0 well, 1 the run diverged, 2 bad input, 130 interrupted."""
    signal.signal(signal.SIGINT, _interrupt)
    from mjskip.cli import main as run

    try:
        run(interrupted=lambda: bool(_interrupts))
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # nothing is left but to end


if __name__ == "__main__":
    main()
