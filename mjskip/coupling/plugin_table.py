"""The records of wet bodies that compiled code of the plugin finds by the hash of what they are made from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.coupling import _plugin_kernels as kernels
from mjskip.coupling._table_kernels import PAIRS, SLOTS
from mjskip.coupling.wet import BuiltHull


@dataclass(frozen=True, kw_only=True)
class Kept:
    """A record with what it points to, and the hull it was made of."""

    record: Array
    blocks: tuple[Array, ...] = ()
    built: BuiltHull | None = None

    @property
    def nbytes(self) -> int:
        return self.record.nbytes + sum(block.nbytes for block in self.blocks)


class Records:
    """Every record that was made, by the hash of what it was made from.

    Compiled code reads the table at any time, from any thread. Tables that were replaced are kept, and
    records that were dropped too, until as many again are dropped: the older half when memory runs short.
    """

    KEPT_BYTES = 2**26

    def __init__(self) -> None:
        self.made: dict[int, Kept | int] = {}
        self._bytes = 0
        self._retired: list[Any] = []
        self._dropped: list[Any] = []
        self._set_slots(1024)

    def add(self, key: int, found: Kept | int) -> int:
        """Remember a record, or kernels.CANNOT or DRY; what the table has for it."""
        if self._bytes > self.KEPT_BYTES:
            self._drop_older_half()
        elif 2 * len(self.made) >= self.table[SLOTS]:
            self._retired.append(self.table)
            self._set_slots(2 * int(self.table[SLOTS]))
        if key in self.made:
            self._retired.append(self.made[key])
        self.made[key] = found
        self._bytes += 0 if isinstance(found, int) else found.nbytes
        return self._put(key, found)

    def _drop_older_half(self) -> None:
        old = self.made
        self._dropped = [*self._retired, self.table, old]
        self._retired = []
        self.made = dict(list(old.items())[len(old) // 2 :])
        self._bytes = sum(0 if isinstance(k, int) else k.nbytes for k in self.made.values())
        slots = 1024
        while slots <= 2 * len(self.made):
            slots *= 2
        self._set_slots(slots)

    def _set_slots(self, slots: int) -> None:
        self.table = np.zeros(PAIRS + 2 * slots, dtype=np.int64)
        self.table[SLOTS] = slots
        for key, found in self.made.items():
            self._put(key, found)
        kernels.root[kernels.TABLE] = self.table.ctypes.data

    def _put(self, key: int, found: Kept | int) -> int:
        mask = int(self.table[SLOTS]) - 1
        k = key & mask
        while self.table[PAIRS + 2 * k] not in (0, key):
            k = (k + 1) & mask
        value = found if isinstance(found, int) else found.record.ctypes.data
        self.table[PAIRS + 2 * k + 1] = value
        self.table[PAIRS + 2 * k] = key
        return value
