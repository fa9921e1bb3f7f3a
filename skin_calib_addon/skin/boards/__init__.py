"""Rigid hexagonal boards: placement on a surface, filling a region."""
