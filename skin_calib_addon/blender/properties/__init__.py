# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of the plan, saved in the .blend."""
