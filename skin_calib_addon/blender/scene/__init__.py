# SPDX-License-Identifier: GPL-3.0-or-later
"""Between the scene and arrays: links, plans, units, results."""
