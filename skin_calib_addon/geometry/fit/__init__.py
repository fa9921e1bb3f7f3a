"""Fitting a surface along the lines of a grid, and finding the smallest grid for a tolerance."""
