"""B-spline surfaces, distances to them, their centre."""
