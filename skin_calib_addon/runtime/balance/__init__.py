"""Supporting polygons, wrench cones, footholds and walking references."""
