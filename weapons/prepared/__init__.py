"""Prepared weapons, which fire one shot a call at little cost."""
