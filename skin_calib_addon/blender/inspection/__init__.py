# SPDX-License-Identifier: GPL-3.0-or-later
"""Inspection of fitted skins: taxels, comparison, touches, replay."""
