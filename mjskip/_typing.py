"""Types that every part of the package uses; shapes and units are in the docstrings of what takes or gives them."""

import os
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]
Complex = npt.NDArray[np.complex128]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8]

PathLike = str | os.PathLike[str]
"""A path as text or as an object."""

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do."""
