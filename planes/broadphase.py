"""Which boxes overlap which: four structures with one contract, and one for objects made of parts."""

from planes.boxes import BroadPhase, BruteForce, Cells, Work
from planes.bvh import Bvh, PartsBvh
from planes.grids import Grid
from planes.quadtree import Quadtree

__all__ = ["BroadPhase", "BruteForce", "Grid", "Quadtree", "Bvh", "PartsBvh", "Cells", "Work"]
