# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the view for planes and skins."""
