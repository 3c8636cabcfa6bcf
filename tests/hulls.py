"""Hulls that tests and `scripts/validation/floating_oracle.py` share."""

import numpy as np

RADIUS = 0.15
KA = (0.2, 0.3, 0.6, 1.0, 1.2, 1.6, 2.0)
APART = 0.45
"""Between the middles of two spheres side by side [m]."""
BARGE_CENTRE = -0.02
BARGE_OMEGA = [2.5, 3.5, 4.5, 5.5, 6.0, 6.5, 7.0, 8.0]
SHIP_LENGTH, SHIP_BEAM, SHIP_DRAFT, SHIP_CENTRE = 1.0, 0.2, 0.0625, -0.01
SHIP_OMEGA = [3.0, 4.5, 6.0, 7.0, 8.0, 9.0]


def ship_panels(along=40, down=8):
    """A Wigley hull, y = B/2 (1 - (2x/L)^2)(1 - (z/T)^2), below the water: points and quadrangles."""
    x = 0.5 * SHIP_LENGTH * np.linspace(-1.0, 1.0, along + 1)
    z = -SHIP_DRAFT * np.linspace(0.0, 1.0, down + 1)
    points, faces = [], []
    for side in (1.0, -1.0):
        first = len(points)
        for a in x:
            for b in z:
                y = 0.5 * SHIP_BEAM * (1 - (2 * a / SHIP_LENGTH) ** 2) * (1 - (b / SHIP_DRAFT) ** 2)
                points.append([a, side * y, b])
        for i in range(along):
            for j in range(down):
                k = first + i * (down + 1) + j
                corners = [k, k + 1, k + down + 2, k + down + 1]
                faces.append(corners if side < 0 else corners[::-1])
    return np.array(points), np.array(faces)


def ship_triangles(along=24, down=5):
    """The same as triangles, closed by its waterplane."""
    points, faces = ship_panels(along, down)
    triangles = [points[f[[0, 1, 2]]] for f in faces] + [points[f[[0, 2, 3]]] for f in faces]
    triangles = np.array(triangles)
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    return triangles[area > 1e-12]
