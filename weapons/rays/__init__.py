"""Rays: their contacts with items, first hits, passes through objects, and ends."""
