"""``diff``: compare two calibrations of one link."""

import argparse

from ..calibration.file import load_with_warnings
from ..inspection.difference import differ
from .common import DONE, WRONG_DATA, complain, named_path, positive, say


def add(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Taxels are paired by their ids. Without --tolerance the exit code is 0 whatever differs. The surface, the "
        "uncertainties and other members that differ are named. Warnings that only one of the files has are on stderr."
    )
    parser.add_argument("first", type=named_path, metavar="A", help="calibration file")
    parser.add_argument("second", type=named_path, metavar="B", help="calibration file to compare with it")
    parser.add_argument(
        "--tolerance",
        type=positive("distance in millimetres"),
        metavar="MM",
        help="exit code 1 if a taxel, or the edge of its cell by the angle of its normal, moved by more, or if a taxel "
        "is added, removed, renumbered, or has another response",
    )


def run(options: argparse.Namespace) -> int:
    (a, warnings_a), (b, warnings_b) = load_with_warnings(options.first), load_with_warnings(options.second)
    found = differ(a, b)
    say("\n".join(found.lines()))
    for path, warnings, others in ((options.first, warnings_a, warnings_b), (options.second, warnings_b, warnings_a)):
        known = {warning.message for warning in others}
        for warning in warnings:
            if warning.message not in known:
                complain(f"only {path}: {warning}")
    reasons = [] if options.tolerance is None else found.beyond(options.tolerance * 1e-3)
    if reasons:
        complain(f"the calibrations differ by more than {options.tolerance:g} mm: {', '.join(reasons)}")
        return WRONG_DATA
    return DONE
