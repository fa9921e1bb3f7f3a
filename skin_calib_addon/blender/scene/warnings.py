# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings to the properties that keep them."""

from collections.abc import Iterable
from typing import Any

from ...common.warnings import Warning


def write_warnings(records: Any, warnings: Iterable[Warning]) -> None:
    """Replace the warnings of a collection property.

    Parameters
    ----------
    records : collection of SKIN_PG_warning
        Its entries are replaced.
    warnings : iterable of Warning
        Points in metres in the link frame.
    """
    records.clear()
    for warning in warnings:
        record, where = records.add(), warning.where
        record.code, record.severity = warning.code, warning.severity
        record.message, record.advice = warning.message, warning.advice
        record.value = warning.value or 0.0
        record.has_point = where.point is not None
        record.point = where.point or (0.0, 0.0, 0.0)
        record.names, record.skin = where.names, where.skin
