"""Measuring: studies of error against run time, stability on hard input, other libraries, and a demo."""
