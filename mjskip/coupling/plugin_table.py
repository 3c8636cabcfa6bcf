"""The records of wet bodies that compiled code of the plugin finds by the hash of what they are made from."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.coupling import _plugin_kernels as kernels
from mjskip.coupling._table_kernels import PAIRS, SLOTS
from mjskip.coupling.wet import BuiltHull


@dataclass(frozen=True, kw_only=True)
class Kept:
    """A record with what it points to, and the hull it was made of as long as the registry has it."""

    record: Array
    blocks: tuple[Array, ...] = ()
    built: weakref.ref[BuiltHull] | None = None

    @property
    def nbytes(self) -> int:
        return self.record.nbytes + sum(block.nbytes for block in self.blocks)


def bytes_of(found: Kept | int) -> int:
    """Memory that a slot of the table and its record take, about."""
    return 100 if isinstance(found, int) else 100 + found.nbytes


class Records:
    """Records by the hash of what they were made from, as long as somebody looks them up.

    Compiled code reads the table at any time, from any thread, and stamps what it looks up with the number of the
    round. A round ends when the records fill the memory set aside, and twice what was in use as the round began:
    what nobody looked up in it is dropped. A thread may still be reading what was dropped, or a table
    that was replaced: both stay until the next round ends.
    """

    KEPT_BYTES = 2**25

    def __init__(self) -> None:
        self.made: dict[int, Kept | int] = {}
        self._bytes = 0
        self._most = self.KEPT_BYTES
        self._round = 0
        self._retired: list[Any] = []
        self._dropped: list[Any] = []
        self._set_slots({})

    def add(self, key: int, found: Kept | int) -> int:
        """Remember a record, or kernels.CANNOT or DRY; what the table has for it."""
        if self._bytes > self._most:
            self._end_round()
        elif 2 * len(self.made) >= self.table[SLOTS]:
            self._retired.append(self.table)
            self._set_slots(self._stamps())
        if key in self.made:
            self._retired.append(self.made[key])
        self.made[key] = found
        self._bytes += bytes_of(found)
        return self._put(key, found, self._round)

    def _end_round(self) -> None:
        stamps, made = self._stamps(), self.made
        self._dropped = [*self._retired, self.table, made]
        self._retired = []
        self.made = {key: found for key, found in made.items() if stamps[key] == self._round}
        self._bytes = sum(map(bytes_of, self.made.values()))
        self._most = max(self.KEPT_BYTES, 2 * self._bytes)
        self._round += 1
        self._set_slots(stamps)

    def _stamps(self) -> dict[int, int]:
        """The round in which each record was last looked up, by its hash."""
        slots = int(self.table[SLOTS])
        keys, stamps = self.table[PAIRS : PAIRS + 2 * slots : 2], self.table[PAIRS + 2 * slots : -1]
        used = keys != 0
        return dict(zip(keys[used].tolist(), stamps[used].tolist(), strict=True))

    def _set_slots(self, stamps: Mapping[int, int]) -> None:
        """A new table of all records, at most a quarter full."""
        slots = 1024
        while slots <= 4 * len(self.made):
            slots *= 2
        self.table = np.zeros(PAIRS + 3 * slots + 1, dtype=np.int64)
        self.table[SLOTS], self.table[-1] = slots, self._round
        for key, found in self.made.items():
            self._put(key, found, stamps[key])
        kernels.root[kernels.TABLE] = self.table.ctypes.data

    def _put(self, key: int, found: Kept | int, stamp: int) -> int:
        slots = int(self.table[SLOTS])
        k = key & (slots - 1)
        while self.table[PAIRS + 2 * k] not in (0, key):
            k = (k + 1) & (slots - 1)
        value = found if isinstance(found, int) else found.record.ctypes.data
        self.table[PAIRS + 2 * slots + k] = stamp
        self.table[PAIRS + 2 * k + 1] = value
        self.table[PAIRS + 2 * k] = key
        return value
