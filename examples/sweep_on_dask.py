"""A sweep on a Dask cluster, resumable: where does the lake's pebble skip?

    python examples/sweep_on_dask.py [STORE.zarr]

Makes a cluster of two workers on this machine; give `scheduler=` any other address instead. Needs mjskip[sweep].
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import mjskip
from mjskip.sweeps.design import normal, span


def main(arguments):
    """Throw 1728 stones; asked again with the same store, it goes on where it stopped."""
    from distributed import LocalCluster

    with tempfile.TemporaryDirectory() as folder:
        store = Path(arguments[0]) if arguments else Path(folder, "lake.zarr")
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            data = mjskip.sweep(
                "lake",
                {"attack": span(*np.radians([5, 60]), 12), "speed": span(4, 14, 9)},
                scatter=normal({"speed": (0, 0.3), "attack": (0, 0.035)}, count=16, seed=0),
                scheduler=cluster.scheduler_address,
                path=store,
            )
        skips = data.skips.mean("member")
        best = skips.argmax(...)
        attack = float(np.degrees(data.attack[best["attack"]]))
        print(
            f"most skips, {float(skips.max()):.1f}, at {attack:.0f} degrees and {float(data.speed[best['speed']]):.0f} m/s"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
