"""``check``: every finding of a calibration or plan file."""

import argparse
from pathlib import Path

from ..calibration.file import check_bytes
from ..calibration.strict_json import parse, read
from ..plan import FORMAT, check_plan_wholly
from .common import DONE, WRONG_DATA


def add(commands) -> None:
    check = commands.add_parser("check", help="validate a calibration or plan file")
    check.add_argument("file", type=Path, metavar="FILE")
    check.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    data = read(options.file)
    document, findings = parse(data)
    if isinstance(document, dict) and document.get("format") == FORMAT:
        findings = tuple(findings) or check_plan_wholly(document)
    else:
        findings = check_bytes(data)[1]
    for finding in findings:
        print(finding)
    errors = sum(f.severity == "error" for f in findings)
    print(f"{options.file}: {errors} errors, {len(findings) - errors} warnings")
    return WRONG_DATA if errors else DONE
