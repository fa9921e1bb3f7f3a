"""What the benchmarks of proposals read in plans, and write into pages of the documentation."""

import re
import sys
from pathlib import Path

MARKS = "<!-- begin of the table -->\n", "<!-- end of the table -->\n"  # around the table of a page
LEFT_OUT = r"(\d+) cm\^2, left out"  # in the reasons of a plan


def write_table(page: Path, table: str, marks: tuple[str, str] = MARKS) -> None:
    """Replace what a page has between two marks; stop with a message if it does not have both."""
    before, first, rest = page.read_text(encoding="utf-8").partition(marks[0])
    _, last, after = rest.partition(marks[1])
    if not last:
        sys.exit(f"{page} does not have the lines {marks[0].strip()} and {marks[1].strip()}")
    page.write_text(f"{before}{first}\n{table.strip()}\n\n{last}{after}", encoding="utf-8")


def left_out_area(reasons: str) -> int:
    """Return the area of the surfaces that a proposal left out, because no skin fits [cm^2]."""
    return sum(int(area) for area in re.findall(LEFT_OUT, reasons))
