# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings to the properties that keep them."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ...common.errors import SkinCalibError
from ...common.warnings import NOWHERE, Place, Warning, worst_first
from .skins import in_window


def refusal_of(error: SkinCalibError) -> Warning:
    """Return the error of a refused fit as a warning record; its code is the class where the error has none."""
    code = error.numbers.get("code", type(error).__name__)
    place = error.numbers.get("place", NOWHERE)
    place = replace(
        place, skin=place.skin or error.numbers.get("skin", ""), surface=error.numbers.get("surface", place.surface)
    )
    value = error.numbers.get("achievable", error.numbers.get("overlap"))
    return Warning(code, "error", in_window(error), place, value)


def write_warnings(records: Any, warnings: Iterable[Warning]) -> None:
    """Replace the warnings of a collection property; the worst ones come first."""
    records.clear()
    for warning in worst_first(warnings):
        record, where = records.add(), warning.where
        record.code, record.severity = warning.code, warning.severity
        record.message, record.advice = warning.message, warning.advice
        record.value = warning.value or 0.0
        record.has_point = where.point is not None
        record.point = where.point or (0.0, 0.0, 0.0)
        record.names, record.skin, record.surface = where.names, where.skin, where.surface


def read_warning(record: Any) -> Warning:
    """Return the warning that a record keeps."""
    point = tuple(record.point) if record.has_point else None
    place = Place(point, record.names, record.skin, surface=record.surface)
    return Warning(record.code, record.severity, record.message, place, record.value, record.advice)
