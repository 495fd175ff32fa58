"""Integer geometry: positions and directions on the 1/256-px grid, row spans of pixels, rasterized shapes and rays."""
