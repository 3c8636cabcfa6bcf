"""The command `mjskip`, and python -m mjskip: quiet when interrupted, imports included."""

import os
import signal
from types import FrameType

INTERRUPTED = 130


def _end_at_once(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)  # nothing has been begun that would have to be ended


def main() -> None:
    """Run a command and exit: 0 well, 1 the run diverged, 2 bad input, 130 interrupted."""
    before = signal.signal(signal.SIGINT, _end_at_once)
    from mjskip.cli import main as run

    signal.signal(signal.SIGINT, before)
    try:
        run()
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0
    else:
        code = 0
    signal.signal(signal.SIGINT, _end_at_once)  # nothing is left to be lost
    raise SystemExit(code)


if __name__ == "__main__":
    main()
