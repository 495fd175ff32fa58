"""The scene: sprites and their masks, objects by role, the stack that decides hits, history, and rendering."""
