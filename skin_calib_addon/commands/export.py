"""``export``: write the taxels of a calibration in the format of another program."""

import argparse
from pathlib import Path

from ..calibration.exchange import FORMATS, WRITABLE, only_patches
from ..calibration.file import load_calibration
from ..common.atomic_file import write_bytes_safely
from .common import DONE, check_target, listed, say


def add(commands) -> None:
    export = commands.add_parser(
        "export",
        help="write the taxels of a calibration for another program",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=listed(WRITABLE),
    )
    export.add_argument("file", type=Path, metavar="FILE", help="calibration file")
    export.add_argument("--to", required=True, choices=WRITABLE, metavar="FORMAT", help="one of the formats below")
    export.add_argument("-o", "--output", required=True, type=Path, metavar="OUT", help="file to write")
    export.add_argument(
        "--patch", action="append", default=[], metavar="NAME", help="write only this patch; can be repeated"
    )
    export.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    check_target(options.output, options.file)
    calibration, format = load_calibration(options.file), FORMATS[options.to]
    if options.patch:
        calibration = only_patches(calibration, options.patch)
    write_bytes_safely(options.output, format.write(calibration))
    taxels, patches = sum(len(patch.taxels.ids) for patch in calibration.patches), len(calibration.patches)
    say(f"{options.output}: {format.what}, {taxels} taxels in {patches} patches; ids in the file: {format.labels}")
    return DONE
