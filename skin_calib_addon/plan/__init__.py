"""The author's choices for one link: what to cut, where the planes are, which skins."""

from .document import plan_document, plan_from
from .file import check_plan, check_plan_wholly, load_plan, save_plan
from .keys import FORMAT
from .plan import Plan, named_from

__all__ = [
    "FORMAT",
    "Plan",
    "check_plan",
    "check_plan_wholly",
    "load_plan",
    "named_from",
    "plan_document",
    "plan_from",
    "save_plan",
]
