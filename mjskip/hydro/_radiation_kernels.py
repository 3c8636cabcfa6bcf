"""A floating body and the plane waves of the surface, at run time.

Of every ring j of waves, with directions theta_n, a body at (X, Y) with heading psi sees the harmonics

    q_m = w_j sum_n c_n exp(i k (X cos theta_n + Y sin theta_n)) exp(i m (theta_n - psi)),  |m| <= M_j

and a table, made in the body's own frame, turns the real and imaginary parts of all q into what it needs: wave
force and the panels' flow. The other way the body's motion and that flow give harmonics S_m, and

    c_n += exp(-i k (X cos theta_n + Y sin theta_n)) sum_m S_m exp(i m (theta_n - psi))

Drift and yaw are exact, of any size within the reach of the modes. Harmonics are stored as cosine and sine parts
(order m >= 0): real and imaginary part of q_0 .. q_M by cos, then of q_1 .. q_M by sin.
"""

import math
from typing import Any

from mjskip._compile.jit import kernel, vector_kernel


@vector_kernel
def _dot(a: Any, b: Any) -> float:
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def gather(
    real: Any, imag: Any, first: Any, orders: Any, starts: Any, turn_at: Any, turns: Any, yaw: float,
    harmonics: Any,
) -> None:  # fmt: skip
    """Harmonics q of waves that are already placed at the body's origin, weights included in the table.

    Args:
        real: of the placed waves (size,), and `imag`.
        first: index of the first wave of every ring, and of the end.
        orders: M of every ring.
        starts: where a ring's harmonics start in `harmonics`; 2 (2 M + 1) numbers each.
        turn_at: where a ring's cosines start in `turns`.
        turns: for a ring cos(m theta_n), n fastest, m = 0 .. M, then sin(m theta_n), m = 1 .. M.
        yaw: heading of the body [rad].
        harmonics: out.
    """
    for j in range(orders.shape[0]):
        a, b, order = first[j], first[j + 1], orders[j]
        count = b - a
        at, table = starts[j], turn_at[j]
        re, im = real[a:b], imag[a:b]
        for m in range(order + 1):
            cosines = turns[table + m * count : table + (m + 1) * count]
            cr, ci = _dot(re, cosines), _dot(im, cosines)
            if m == 0:
                harmonics[at], harmonics[at + 1] = cr, ci
                continue
            shift = table + (order + m) * count
            sines = turns[shift : shift + count]
            sr, si = _dot(re, sines), _dot(im, sines)
            cosine, sine = math.cos(m * yaw), math.sin(m * yaw)
            p = at + 2 * m
            q = at + 2 * (order + m)
            # cos m(theta - psi) and sin m(theta - psi)
            harmonics[p], harmonics[p + 1] = cr * cosine + sr * sine, ci * cosine + si * sine
            harmonics[q], harmonics[q + 1] = sr * cosine - cr * sine, si * cosine - ci * sine


@kernel
def scatter(
    harmonics: Any, first: Any, orders: Any, starts: Any, turn_at: Any, turns: Any, yaw: float,
    real: Any, imag: Any,
) -> None:  # fmt: skip
    """Waves of harmonics S about the body's origin, into real and imag (size,)."""
    for j in range(orders.shape[0]):
        a, b, order = first[j], first[j + 1], orders[j]
        count = b - a
        at, table = starts[j], turn_at[j]
        for n in range(a, b):
            real[n], imag[n] = harmonics[at], harmonics[at + 1]
        for m in range(1, order + 1):
            cosine, sine = math.cos(m * yaw), math.sin(m * yaw)
            p = at + 2 * m
            q = at + 2 * (order + m)
            cr = harmonics[p] * cosine - harmonics[q] * sine
            ci = harmonics[p + 1] * cosine - harmonics[q + 1] * sine
            sr = harmonics[p] * sine + harmonics[q] * cosine
            si = harmonics[p + 1] * sine + harmonics[q + 1] * cosine
            up = table + m * count
            down = table + (order + m) * count
            for n in range(count):
                real[a + n] += cr * turns[up + n] + sr * turns[down + n]
                imag[a + n] += ci * turns[up + n] + si * turns[down + n]


@kernel
def read_rows(rows: Any, harmonics: Any, out: Any) -> None:
    """out_i = rows_i . harmonics."""
    for i in range(rows.shape[0]):
        out[i] = _dot(rows[i], harmonics)


@kernel
def add_columns(columns: Any, amounts: Any, out: Any) -> None:
    """out = sum_i amounts_i columns_i."""
    for n in range(out.shape[0]):
        out[n] = 0.0
    for i in range(columns.shape[0]):
        amount = amounts[i]
        column = columns[i]
        for n in range(out.shape[0]):
            out[n] += amount * column[n]


@kernel
def advance_waves(
    real: Any, imag: Any, added_real: Any, added_imag: Any, turn_real: Any, turn_imag: Any, step: float
) -> None:  # fmt: skip
    """c = exp(-i omega dt) (c + dt S): the surface's own motion is exact."""
    for n in range(real.shape[0]):
        a, b = real[n] + step * added_real[n], imag[n] + step * added_imag[n]
        real[n] = a * turn_real[n] - b * turn_imag[n]
        imag[n] = a * turn_imag[n] + b * turn_real[n]
