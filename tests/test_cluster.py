"""The same sweep on a Dask cluster: real scheduler, real workers, one of them killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager

import pytest

from mjskip import Limits, Stone, Throw
from mjskip.errors import MjskipError
from mjskip.sweeps.design import normal, span
from mjskip.sweeps.store import open_sweep
from mjskip.sweeps.sweep import sweep

pytest.importorskip("distributed", reason="needs pip install 'mjskip[sweep]'")

# distributed leaves sockets and threads of its event loop to the garbage collector
pytestmark = pytest.mark.filterwarnings(
    "default::ResourceWarning", "default::pytest.PytestUnraisableExceptionWarning"
)

SWEEP = {
    "vary": {"attack": span(0.2, 0.5, 8), "descent": span(0.05, 0.3, 4)},
    "scatter": normal({"speed": (0.0, 0.3)}, count=4, seed=4),
    "throw": Throw(height=0.05, speed=8.0),
    "limits": Limits(duration=1.0),
    "timestep": 2e-4,
    "chunk": 4,
}
STONE = Stone.disc(0.04, 0.008)


def contents(store):
    """Every file of a store, by name."""
    return {
        str(p.relative_to(store)): p.read_bytes() for p in sorted(store.rglob("*")) if p.is_file()
    }


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def process(*command):
    """A process of Dask's command line, on loopback, gone at the end."""
    environment = os.environ | {"DASK_DISTRIBUTED__DEPLOY__LOST_WORKER_TIMEOUT": "2s"}
    started = subprocess.Popen(
        [sys.executable, "-m", "dask", *command], env=environment,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield started
    finally:
        started.kill()
        started.wait()


@contextmanager
def cluster(workers=2):
    """Address of a scheduler, its process, and those of its workers."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    with ExitStack() as stack:
        scheduler = stack.enter_context(
            process("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
        )
        started = [
            stack.enter_context(
                process(
                    "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
                    "--host", "127.0.0.1", "--memory-limit", "0",
                )
            )
            for _ in range(workers)
        ]  # fmt: skip
        from distributed import Client

        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address, scheduler, started


def test_a_cluster_that_loses_a_worker_writes_the_bytes_of_the_serial_run(tmp_path):
    alone, spread = tmp_path / "alone.zarr", tmp_path / "spread.zarr"
    sweep(STONE, **SWEEP, path=alone)
    killed = []
    with cluster() as (address, _, workers):

        def kill_one(done, total):
            if done >= total // 4 and not killed:
                workers[0].send_signal(signal.SIGKILL)
                killed.append(done)

        sweep(STONE, **SWEEP, path=spread, scheduler=address, progress=kill_one)
        assert workers[0].wait(10) == -signal.SIGKILL
        assert workers[1].poll() is None
    assert 0 < killed[0] < 128
    assert contents(spread) == contents(alone)


def test_a_lost_scheduler_leaves_a_store_to_go_on_with(tmp_path):
    store, whole = tmp_path / "lost.zarr", tmp_path / "whole.zarr"
    with cluster() as (address, scheduler, _):

        def kill(done, total):
            if done >= total // 4:
                scheduler.send_signal(signal.SIGKILL)

        import dask

        patience = dask.config.set({"distributed.comm.timeouts.connect": "3s"})
        begun = time.monotonic()
        with patience, pytest.raises(MjskipError, match="ask again to go on"):
            sweep(STONE, **SWEEP, path=store, scheduler=address, progress=kill)
        assert time.monotonic() - begun < 60
    done = int((open_sweep(store).status == "ok").sum())
    assert 32 <= done < 128
    sweep(STONE, **SWEEP, path=store)
    sweep(STONE, **SWEEP, path=whole)
    assert contents(store) == contents(whole)


def test_a_scheduler_that_is_not_there_is_said_so_in_one_line(monkeypatch):
    monkeypatch.setattr("mjskip.sweeps.cluster.TIMEOUT", 1.0)
    with pytest.raises(MjskipError, match="no Dask scheduler answers at tcp://127"):
        sweep(STONE, **SWEEP, scheduler=f"tcp://127.0.0.1:{free_port()}")
    with pytest.raises(MjskipError, match="no Dask scheduler answers at nonsense"):
        sweep(STONE, **SWEEP, scheduler="nonsense://1")


def test_without_distributed_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MjskipError, match=r"pip install 'mjskip\[sweep\]'"):
        sweep(STONE, **SWEEP, scheduler="tcp://127.0.0.1:1")
