# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking at fitted skins: taxels, comparison, touches, replay."""
