"""Control with the skin: virtual wrenches, joint torques, reflexes, wrench cones, footholds, walking. Needs NumPy only.

It uses the public names of ``skin_calib_addon.runtime``. Each module is imported by its name.
"""
