"""Foundations: input checks, limits, tables of JSON forms, caches, and the choice between numpy and compiled code."""
