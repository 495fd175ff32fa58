"""Bounding volumes: exact predicates on float64, overlap tests of all pairs, and volumes fitted to masks."""
