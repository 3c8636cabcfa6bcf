"""The water surface: a damped wave equation on a grid, driven by loads."""

from mjskip.waves.field import HeightField as HeightField
from mjskip.waves.field import SurfaceSample as SurfaceSample
from mjskip.waves.wind import wind_waves as wind_waves
