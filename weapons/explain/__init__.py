"""Explanations of hits, made when they are asked for: samples, shares, why not, blockers, margins."""
