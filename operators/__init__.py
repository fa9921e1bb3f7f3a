# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: each reads the scene, calls one function, writes the scene, and reports."""
