"""The author's choices as a file: what to cut, where the planes are, which skins."""

from .plan import (
    FORMAT,
    VERSION,
    Plan,
    check_frame,
    check_plan,
    check_plan_wholly,
    load_plan,
    named_from,
    plan_document,
    plan_from,
    save_plan,
)

__all__ = [
    "FORMAT",
    "VERSION",
    "Plan",
    "check_frame",
    "check_plan",
    "check_plan_wholly",
    "load_plan",
    "named_from",
    "plan_document",
    "plan_from",
    "save_plan",
]
