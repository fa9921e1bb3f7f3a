"""Triangle meshes: reading, cover, defects, units."""
