# SPDX-License-Identifier: GPL-3.0-or-later
"""Previews and checks that follow a change."""
