"""The water on its own: rings that meet a pier, no MuJoCo and no stone.

python examples/rings_around_a_pier.py [PICTURE.png]
"""

import sys

import numpy as np

import mjskip


def main(arguments):
    """Drop a bump, let the rings run, and say what the pier does to them."""
    x = 0.02 * (np.arange(200) - 99.5)
    pier = (np.abs(x)[:, None] < 0.1) & (np.abs(x - 0.8)[None, :] < 0.4)
    field = mjskip.HeightField((200, 200), 0.02, boundary="absorb", terrain_mask=pier)
    field.displace(-0.8, 0.8, height=0.03, radius=0.15)
    started = field.volume()
    field.advance(1.2)
    before, behind = field.sample([-0.3, 0.5], [0.8, 0.8]).elevation
    print(f"before the pier {1e3 * before:+.2f} mm, behind it {1e3 * behind:+.2f} mm")
    print(f"water made by the pier: {field.volume() - started:.2e} m3 (what left is missing)")
    if arguments:
        import mediapy

        mediapy.write_image(
            arguments[0], mediapy.to_rgb(field.elevation.T[::-1], vmin=-0.004, vmax=0.004)
        )


if __name__ == "__main__":
    main(sys.argv[1:])
