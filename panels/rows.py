# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a panel from the table of plan keys."""

from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene.plans import is_simple
from ..skin_calib_addon.plan.keys import PLAN
from .base import field


def keys_in(panel):
    """Return the keys of the plan that are one property each, in a panel."""
    return [key for key in PLAN.keys if key.panel == panel and is_simple(key)]


def draw_keys(layout, group, keys, own=None):
    """Draw the rows of keys, one below the other."""
    column = None
    for key in keys:
        if not key.label:
            continue
        if column is None or not key.joined:
            column = layout.column(align=True)
        (own or {}).get(key.name, draw_key)(column, group, key)


def draw_key(layout, group, key):
    """Draw the row of one key: its switch first, and its value where it does not have the default."""
    if has_switch(key):
        field(layout, group, key.switch.name)
    draw_value(layout, group, key)


def draw_value(layout, group, key):
    """Draw the value of a key, where its switch does not hide it."""
    if has_switch(key) and getattr(group, key.switch.name) == key.switch.means_default:
        return
    if key.type.record is not None:
        draw_keys(layout, group, key.type.record.keys)
    elif key.labels:
        for i, label in enumerate(key.labels):
            field(layout, group, shown(group, key.property_name), index=i, text=label)
    else:
        field(layout, group, shown(group, key.property_name))


def has_switch(key):
    """Return whether the key has a switch here: a required key has none."""
    return key.switch is not None and not key.is_required
