"""Propose plans for the links of a robot: which surfaces can carry skin, and which skins."""
