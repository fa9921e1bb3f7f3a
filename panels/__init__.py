# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tabs Skin and Inspect, the menu Skin, and the state in the header; they draw stored values."""
