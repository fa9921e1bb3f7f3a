# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that uses Blender: scene, properties, drawing, handles."""
