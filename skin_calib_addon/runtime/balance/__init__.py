"""Compute supporting polygons, wrench cones, footholds and walking references."""
