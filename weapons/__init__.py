"""The shot: what is fired, and what it did."""
