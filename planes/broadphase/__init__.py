"""Broad phases: four structures that find overlapping boxes, with one contract, and one for objects made of parts."""

from .boxes import BroadPhase, BruteForce, Cells, Work
from .bvh import Bvh, PartsBvh
from .grids import Grid
from .quadtree import Quadtree

__all__ = ["BroadPhase", "BruteForce", "Grid", "Quadtree", "Bvh", "PartsBvh", "Cells", "Work"]
