"""``import``: convert the taxels of another program to a table, or place them on the link of a plan."""

import argparse
from typing import Any

from ..calibration.exchange import READABLE, listed, read_taxels, write_taxel_set
from ..calibration.file import save_calibration
from ..common.atomic_file import write_bytes_safely
from ..common.errors import InvalidPlan
from ..common.strict_json import parse
from ..pipeline import calibrate
from ..pipeline.report import summary
from ..plan import Plan, check_plan, load_plan, plan_document, plan_from
from ..plan.file import check_part
from ..skin.imported import placed
from .common import DONE, check_outputs, complain, file_name, named_path, say, warn


def add(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Without --plan, OUT is a table (CSV) of the unchanged taxels, for an imported skin in a plan. "
        "With --plan, OUT is a calibration: the taxels are placed on the link as its only skin."
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = listed(READABLE)
    parser.add_argument("file", type=named_path, metavar="FILE", help="taxel file of another program")
    parser.add_argument(
        "--from", dest="format", choices=READABLE, metavar="FORMAT", help="one of the formats below (default: detected)"
    )
    parser.add_argument("-o", "--output", required=True, type=file_name, metavar="OUT", help="table, or calibration")
    parser.add_argument(
        "--only", metavar="PATTERN", help="read only taxels whose label matches, as in 'l_forearm_skin_*'"
    )
    parser.add_argument(
        "--frame",
        type=_frame,
        metavar="JSON",
        help='{"rotation", "translation"} from the frame of the file to the link frame',
    )
    parser.add_argument("--plan", type=named_path, metavar="PLAN", help="plan of the link of the taxels")
    parser.add_argument("--name", metavar="NAME", help="name of the patch (default: name of the file); needs --plan")


def run(options: argparse.Namespace) -> int:
    if options.plan is None and options.name is not None:
        options.refuse("--name needs --plan: it is the name of a patch of a calibration")
    if options.plan is None and options.output.suffix == ".json":
        options.refuse("a calibration needs the surface of a link: specify its --plan, or a table OUT.csv")
    check_outputs(options, options.plan, options.file)
    return _as_table(options) if options.plan is None else _on_link(options)


def _as_table(options: argparse.Namespace) -> int:
    taxels = read_taxels(options.file, options.format, options.only)
    if options.frame is not None:
        taxels = placed(taxels, options.frame["rotation"], options.frame["translation"])
    write_bytes_safely(options.output, write_taxel_set(taxels))
    for finding in taxels.findings:
        complain(str(finding))
    frame = "no name of a frame" if taxels.frame is None else f"frame {taxels.frame}"
    channels = f"channels {taxels.channels.min()} to {taxels.channels.max()}"
    say(f"{options.output}: table of {len(taxels.labels)} taxels, {channels}, {frame}")
    return DONE


def _on_link(options: argparse.Namespace) -> int:
    plan = _plan(options)
    result = calibrate(plan)
    save_calibration(result.calibration, options.output)
    warn(result.warnings)
    say(summary(result, options.output))
    return DONE


def _plan(options: argparse.Namespace) -> Plan:
    """Return the plan with the file as its only skin."""
    skin = {"name": options.name or options.file.stem, "kind": "imported", "file": str(options.file)}
    given = {"format": options.format, "only": options.only, "frame": options.frame}
    skin |= {name: value for name, value in given.items() if value is not None}
    document = plan_document(load_plan(options.plan)) | {"skins": [skin]}
    findings = check_plan(document)
    if findings:
        raise InvalidPlan(f"{options.file} cannot be a skin of {options.plan}: {findings[0]}")
    return plan_from(document)


def _frame(text: str) -> dict[str, Any]:
    """Parse rotation and translation in JSON, as an error message suggests them."""
    frame, findings = parse(text.encode("utf-8", "replace"))
    findings = tuple(findings) or check_part(frame, "frame")
    if findings:
        raise argparse.ArgumentTypeError(
            'must be {"rotation": [[...], [...], [...]], "translation": [x, y, z]}, as an error message suggests it; '
            f"{findings[0]}"
        )
    return frame
