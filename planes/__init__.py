"""The world of a shot: what can be hit, what blocks, and where it is."""
