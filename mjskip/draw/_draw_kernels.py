"""From the full grid of the water to the few vertices that are drawn."""

import math

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._typing import Array, SingleArray


@kernel
def _span(left: float, right: float, count: int) -> tuple[int, int]:
    """First and one past the last cell touched by [left, right], clipped to the field."""
    return max(0, math.floor(left)), min(count, math.ceil(right))


@kernel
def box_means(
    elevation: SingleArray, spacing: float, x_boxes: Array, y_boxes: Array,
    row_height: Array, row_slope: Array, height: Array, x_slope: Array, y_slope: Array,
) -> None:  # fmt: skip
    """Mean height and slope of the surface over the box of cells that each vertex stands for.

    A vertex (i, j) stands for x_boxes[i, 0] <= u <= x_boxes[i, 1] and likewise along y, in units of
    cells: cell k fills k <= u <= k + 1. Cells count by the share of them inside the box, so waves
    finer than the drawn mesh fade instead of turning into others; outside the field the water is
    still. Slopes are central differences of the full grid (one-sided at its edges), averaged alike.

    Args:
        elevation: (nx, ny) [m].
        spacing: side of a cell [m].
        x_boxes: (vx, 2) borders [cells].
        y_boxes: (vy, 2) borders [cells].
        row_height: scratch (ny,).
        row_slope: scratch (ny,).
        height: out (vx, vy) [m].
        x_slope: out (vx, vy).
        y_slope: out (vx, vy).
    """
    nx, ny = elevation.shape
    vx, vy = height.shape
    for i in range(vx):
        left, right = x_boxes[i, 0], x_boxes[i, 1]
        first, last = _span(left, right, nx)
        for k in range(ny):
            row_height[k] = 0.0
            row_slope[k] = 0.0
        for a in range(first, last):
            weight = (min(right, a + 1.0) - max(left, float(a))) / (right - left)
            before, after = max(a - 1, 0), min(a + 1, nx - 1)
            rise = weight / ((after - before) * spacing)
            for k in range(ny):
                row_height[k] += weight * elevation[a, k]
                row_slope[k] += rise * (elevation[after, k] - elevation[before, k])
        for j in range(vy):
            low, high = y_boxes[j, 0], y_boxes[j, 1]
            start, stop = _span(low, high, ny)
            mean = 0.0
            along_x = 0.0
            along_y = 0.0
            if last > first:
                for b in range(start, stop):
                    weight = (min(high, b + 1.0) - max(low, float(b))) / (high - low)
                    below, above = max(b - 1, 0), min(b + 1, ny - 1)
                    mean += weight * row_height[b]
                    along_x += weight * row_slope[b]
                    along_y += (
                        weight
                        * (row_height[above] - row_height[below])
                        / ((above - below) * spacing)
                    )
            height[i, j] = mean
            x_slope[i, j] = along_x
            y_slope[i, j] = along_y


@kernel
def fill_skin(
    x: Array, y: Array, height: Array, x_slope: Array, y_slope: Array,
    vertices: SingleArray, normals: SingleArray,
) -> None:  # fmt: skip
    """World positions and unit normals (-z_x, -z_y, 1)/|.| of a mesh over the axes x and y.

    Args:
        x: (vx,) [m].
        y: (vy,) [m].
        height: (vx, vy) [m].
        x_slope: (vx, vy).
        y_slope: (vx, vy).
        vertices: out (vx * vy, 3) [m].
        normals: out (vx * vy, 3).
    """
    vx, vy = height.shape
    for i in range(vx):
        for j in range(vy):
            n = i * vy + j
            a, b = x_slope[i, j], y_slope[i, j]
            upright = 1.0 / math.sqrt(1.0 + a * a + b * b)
            vertices[n, 0] = x[i]
            vertices[n, 1] = y[j]
            vertices[n, 2] = height[i, j]
            normals[n, 0] = -a * upright
            normals[n, 1] = -b * upright
            normals[n, 2] = upright


@kernel
def fill_surface(
    elevation: SingleArray, border: int, stride: int, spacing: float, block: int,
    heights: SingleArray, bends: SingleArray, tallest: SingleArray,
) -> None:  # fmt: skip
    """A field as the water's shaders read it: with a border in which it fades into still water.

    Args:
        elevation: (nx, ny) [m].
        border: cells around it.
        stride: of the Laplacian's difference [cells].
        spacing: side of a cell [m].
        block: cells a side of blocks.
        heights: out (nx + 2 border, ny + 2 border) [m].
        bends: out, Laplacians there [1/m].
        tallest: out, greatest height or depth in each block of heights and the eight around it [m].
    """
    nx, ny = elevation.shape
    wide, high = heights.shape
    scale = np.float32(1.0 / (stride * spacing) ** 2)
    kept = (0.5 + 0.5 * np.cos(np.pi * np.arange(border + 1) / border)).astype(np.float32)
    mean = np.empty(ny, np.float32)
    sixth = np.float32(1.0 / 6.0)
    tallest[:] = 0.0
    for i in range(wide):
        a = min(max(i - border, 0), nx - 1)
        off = abs(i - border - a)
        share = kept[off]
        here, out, bend = elevation[a], heights[i], bends[i]
        for j in range(border):
            out[j] = share * kept[border - j] * here[0]
            out[high - 1 - j] = share * kept[border - j] * here[ny - 1]
        # weights (1, 4, 1) / 6 both ways: the means that cubic B-splines take, without creases between cells
        row_before, row_after = elevation[max(a - 1, 0)], elevation[min(a + 1, nx - 1)]
        for j in range(ny):
            mean[j] = share * (row_before[j] + row_after[j] + np.float32(4.0) * here[j]) * sixth
        out[border], out[border + ny - 1] = mean[0], mean[ny - 1]
        for j in range(1, ny - 1):
            out[border + j] = (mean[j - 1] + mean[j + 1] + np.float32(4.0) * mean[j]) * sixth
        for j in range(high):
            bend[j] = 0.0
        if off == 0 and stride <= a < nx - stride:
            before, after = elevation[a - stride], elevation[a + stride]
            for j in range(stride, ny - stride):
                bend[border + j] = scale * (
                    before[j] + after[j] + here[j - stride] + here[j + stride]
                    - np.float32(4.0) * here[j]
                )  # fmt: skip
        row = i // block
        for column in range(tallest.shape[1]):
            most = np.float32(0.0)
            for j in range(column * block, min((column + 1) * block, high)):
                most = max(most, abs(out[j]))
            tallest[row, column] = max(tallest[row, column], most)
    # the greatest of three blocks, along one axis and then along the other
    for axis in range(2):
        blocks = tallest if axis == 0 else tallest.T
        for row in range(blocks.shape[0]):
            before = np.float32(0.0)
            for column in range(blocks.shape[1]):
                here_now = blocks[row, column]
                after = blocks[row, min(column + 1, blocks.shape[1] - 1)]
                blocks[row, column] = max(max(before, here_now), after)
                before = here_now


@kernel
def stroke(
    cover: SingleArray, x0: float, y0: float, x1: float, y1: float, radius: float, strength: float
) -> None:
    """Draw a piece of a line with round ends into a coverage; pieces that overlap do not add up.

    Args:
        cover: (h, w) how much of each pixel is covered, 0 to 1; raised where the line is.
        x0: of one end [pixels].
        y0: of one end [pixels].
        x1: of the other [pixels].
        y1: of the other [pixels].
        radius: half the width [pixels].
        strength: 0 to 1.
    """
    h, w = cover.shape
    reach = radius + 1.0
    dx, dy = x1 - x0, y1 - y0
    squared = dx * dx + dy * dy
    for row in range(max(0, int(min(y0, y1) - reach)), min(h, int(max(y0, y1) + reach) + 2)):
        for column in range(max(0, int(min(x0, x1) - reach)), min(w, int(max(x0, x1) + reach) + 2)):
            u, v = column - x0, row - y0
            along = 0.0
            if squared > 0.0:
                along = min(max((u * dx + v * dy) / squared, 0.0), 1.0)
            off = math.sqrt((u - along * dx) ** 2 + (v - along * dy) ** 2)
            share = strength * min(max(radius + 0.5 - off, 0.0), 1.0)
            if share > cover[row, column]:
                cover[row, column] = share
