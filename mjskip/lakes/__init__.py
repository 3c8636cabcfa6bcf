"""Lakes of any size: only the tiles of water that move are stored and stepped."""

from mjskip.lakes.lake import Lake as Lake
from mjskip.lakes.tiled import TILE as TILE
