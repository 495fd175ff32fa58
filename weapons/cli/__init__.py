"""The command `hitplanes`."""
