"""Weapons: fields, patterns, rays, and the placements of each shot by seeded draws."""
