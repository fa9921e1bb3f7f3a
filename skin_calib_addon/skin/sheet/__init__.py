"""Flexible sheets: isometric placement on a surface."""
