"""Types that every part of the package uses."""

import os
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""An array of doubles; its shape and unit are in the docstring of what takes or gives it."""

PathLike = str | os.PathLike[str]
"""A path as text or as an object."""

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do."""
