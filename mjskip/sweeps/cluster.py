"""The chunks of a sweep as tasks of a Dask cluster.

Workers only work things out: what they find comes back to this process, which writes it. So a worker that dies
costs its chunk and nothing else, no two processes ever write to a store, and workers need not share a disk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import Any

from mjskip.errors import MjskipError
from mjskip.sweeps.job import Question, run_chunk

Index = tuple[slice, ...]

TIMEOUT = 10.0
"""How long a scheduler may take to answer [s]."""


def run_on_cluster(
    address: str,
    job: Question,
    chunks: Sequence[Index],
    take: Callable[[Index, dict[str, Any]], None],
) -> None:
    """Do chunks on the workers of a scheduler and hand over each as it is done, in any order.

    Args:
        address: of the scheduler, such as tcp://127.0.0.1:8786.
        job: the sweep.
        chunks: blocks of its grid.
        take: called with a chunk and its results.

    Raises:
        MjskipError: there is no `distributed`, no scheduler, it is lost, or a chunk fails again and again.
    """
    try:
        import distributed
    except ImportError as error:
        raise MjskipError("a cluster needs packages more: pip install 'mjskip[sweep]'") from error
    cluster: Any = distributed  # untyped
    try:
        client = cluster.Client(address, timeout=TIMEOUT, set_as_default=False)
    except (TimeoutError, OSError, ValueError) as error:
        raise MjskipError(
            f"no Dask scheduler answers at {address} ({_line(error)}): start one with "
            "`dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from error
    with client:
        for index, found in _results(cluster, client, address, job, chunks):
            take(index, found)


def _results(
    cluster: Any, client: Any, address: str, job: Question, chunks: Sequence[Index]
) -> Any:
    """Pairs of chunk and results, as they come."""
    try:
        # the job goes with every task: data kept on a worker would be lost with it
        futures = {
            client.submit(run_chunk, job, index, threads=1, pure=False): index for index in chunks
        }
        for future in cluster.as_completed(futures, loop=client.loop):
            yield futures[future], future.result()
            future.release()
    except (TimeoutError, CancelledError, OSError) as error:
        raise MjskipError(
            f"the scheduler at {address} is lost ({_line(error)}): what is done is kept, ask again to go on"
        ) from error
    except Exception as error:  # what a task raised, or KilledWorker
        raise MjskipError(
            f"a chunk failed on the cluster ({_line(error)}): what is done is kept, ask again to go on"
        ) from error


def _line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__} {error}".split())
