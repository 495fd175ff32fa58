"""What decides hits in bulk: bit rows in tiles, what is visible, label plane, distance field, the walk of spans."""
