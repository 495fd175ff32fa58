"""Files of a scene: PNG images, and the scene folder."""
