# SPDX-License-Identifier: GPL-3.0-or-later
"""Between scene and arrays: the only place in the package that knows Blender."""
