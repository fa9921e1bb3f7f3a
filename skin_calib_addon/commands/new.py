"""``new``: a plan with one skin at one place of a link."""

import argparse
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np

from ..common.arrays import MIN_DIRECTION_LENGTH, Array
from ..common.errors import InvalidMesh, SkinCalibError, counted, millimetres
from ..geometry.blas_threads import one_blas_thread
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT
from ..plan import named_from, save_plan
from ..plan.skins import BoardSkin, SheetSkin
from ..proposal.links import Task, surfaces_of
from ..proposal.one_skin import LinkSurfaces, Placement, nearest_place, place_at, smaller
from ..proposal.skins import SkinChoice, parse_skin
from ..robot.link_mesh import is_urdf
from .common import DONE, WRONG_DATA, check_outputs, complain, count, file_name, named_path, say, warn

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
# [rad] of the direction of the rows to the normal, below which there is a warning. Larger: more warnings; smaller: rows
# in a direction that the author does not expect.
MIN_ALONG = np.deg2rad(30.0)
IMPORT = "import bpy; bpy.ops.skin_calib.import_plan(filepath={!r})"  # a statement of Blender


def add(parser: argparse.ArgumentParser) -> None:
    """Define the command."""
    parser.description = (
        "The skin is on a surface that propose finds, at the point of the link nearest to the given one. If it does "
        "not fit there, no plan is written, and the nearest place where it fits is printed."
    )
    parser._negative_number_matcher = re.compile(r"-\.?\d.*")  # a value such as -10,0,5 is not an option
    parser.add_argument("mesh", nargs="?", type=named_path, metavar="MESH", help="mesh of the link")
    parser.add_argument("--on", metavar="URDF:LINK", type=_on, help="link of a robot, instead of MESH")
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument(
        "--sheet", type=_sheet, metavar="SIZE", help="sheet such as 5x12x10mm: rows, columns of a row, and pitch"
    )
    kind.add_argument(
        "--hexagons",
        nargs="+",
        metavar=("SIDE", "COUNT"),
        help="boards with sides such as 8mm; all that fit, or a number of them",
    )
    parser.add_argument(
        "--at",
        required=True,
        type=_at,
        metavar="X,Y,Z",
        help="point of the link for the middle cell of a sheet, or for the first board, in the link frame; in the unit "
        "of the mesh, or with its own, such as 10,-20,35.5mm",
    )
    parser.add_argument(
        "--along", required=True, type=_vector, metavar="X,Y,Z", help="direction of the rows, in the link frame"
    )
    parser.add_argument("-o", "--output", required=True, type=file_name, metavar="PLAN", help="plan file")
    parser.add_argument("--unit", choices=tuple(METRES_PER_UNIT), help="unit of the numbers of the mesh (default: m)")
    parser.add_argument(
        "--picture", type=file_name, metavar="PNG", help="picture of link, surface, planes and cells, also of a refusal"
    )
    parser.add_argument("--open", action="store_true", help="open the plan in Blender, if it is installed")


def _on(text: str) -> tuple[Path, str]:
    """Parse a link of a robot."""
    file, _, link = text.rpartition(":")
    if not link or not is_urdf(Path(file)):
        raise argparse.ArgumentTypeError(f"{text!r} is not a link of a robot. Write ROBOT.urdf:LINK")
    return Path(file), link


def _sheet(text: str) -> SkinChoice:
    """Parse the size of a sheet."""
    try:
        return parse_skin(f"sheet:{text}")
    except SkinCalibError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not the size of a sheet. Write rows, columns and pitch, such as 5x12x10mm"
        ) from None


def _numbers(text: str, example: str) -> Array:
    """Parse three numbers with commas."""
    numbers = [float(word) if re.fullmatch(NUMBER, word.strip()) else np.nan for word in text.split(",")]
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers. Write them with commas, such as {example}")
    return np.array(numbers)


def _vector(text: str) -> Array:
    """Parse a direction (3,)."""
    vector = _numbers(text, "0,-1,0.5")
    if not MIN_DIRECTION_LENGTH < np.linalg.norm(vector) < np.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a direction: its length is zero or infinite")
    return vector / np.linalg.norm(vector)


def _at(text: str) -> tuple[Array, str]:
    """Parse a point (3,), and its unit; it is empty for that of the mesh."""
    unit = text.lstrip("+-.,0123456789eE ")
    if unit and unit not in METRES_PER_UNIT:
        raise argparse.ArgumentTypeError(f"{unit!r} is not a unit of length. Use {', '.join(METRES_PER_UNIT)}")
    return _numbers(text.removesuffix(unit), "10,-20,35.5mm"), unit


@one_blas_thread()
def run(options: argparse.Namespace) -> int:
    """Write the plan, or print where the skin fits."""
    if (options.mesh is None) == (options.on is None):
        options.refuse("give either a mesh or --on ROBOT.urdf:LINK")
    if options.on and options.unit:
        options.refuse("--unit is the unit of a mesh. A URDF is in metres")
    if options.mesh is not None and is_urdf(options.mesh):
        options.refuse(f"{options.mesh} is a robot. Name its link: --on {options.mesh}:LINK")
    file, name = options.on or (options.mesh, options.mesh.stem)
    check_outputs(options, file)
    if file.is_dir():
        raise InvalidMesh(f"'{file}' is a folder. Name a mesh.")
    choice, boards = _choice(options)
    unit, (at, of_at) = options.unit or "m", options.at
    link, warnings = surfaces_of(Task(file, unit, name, choice))
    for text in warnings:
        complain(f"warning: {text}")
    spot = link.spot(at * METRES_PER_UNIT[of_at or unit], options.along)
    if (angle := np.arccos(min(1.0, abs(float(np.dot(spot.direction, spot.normal)))))) < MIN_ALONG:
        complain(
            f"warning: --along is {np.degrees(angle):.0f} degrees from the normal at the point: the direction of the "
            "rows is nearly arbitrary. Give one along the surface"
        )
    placed = place_at(link, choice.template, boards, spot)
    if placed.problem:
        return _refuse(options, link, choice, boards, placed)
    assert placed.plan is not None and placed.result is not None and placed.proposed is not None
    save_plan(named_from(placed.plan, options.output.parent), options.output)
    warn(placed.result.warnings)
    taxels, skin = placed.result.placed[0].patch.taxels, placed.plan.skins[0]
    first = f"cell (0, 0) at {millimetres(taxels.positions_link[0])}" if isinstance(skin, SheetSkin) else ""
    say(
        f"point        {millimetres(spot.point)} of the mesh, {spot.distance * 1e3:.1f} mm from the given one\n"
        f"surface      {placed.proposed.reason}, mean distance to the mesh {placed.result.mean * 1e3:.3f} mm\n"
        f"skin         {counted(len(taxels.ids), 'taxel')} of {choice.text}; {_middle(skin)} at the point"
        f"{', ' * bool(first)}{first}\n"
        f"plan         {options.output}. Next: skin-calib fit {shlex.quote(str(options.output))} -o "
        f"{shlex.quote(f'{link.link}.calibration.json')}"
    )
    if options.picture:
        _draw(link, placed, None, options.picture)
    if options.open:
        _open(options.output)
    return DONE


def _choice(options: argparse.Namespace) -> tuple[SkinChoice, int | None]:
    """Return the skin of a call, and the number of its boards; None for all that fit."""
    if options.sheet:
        return options.sheet, None
    side, *others = options.hexagons
    try:
        if len(others) > 1:
            options.refuse("--hexagons has a side and a number of boards, such as 8mm 12. Put MESH before it")
        return parse_skin(f"hexagons:{side}"), count(others[0]) if others else None
    except (SkinCalibError, argparse.ArgumentTypeError):
        return options.refuse(f"--hexagons: {' '.join(options.hexagons)!r} is not a side and a number, such as 8mm 12")


def _middle(skin: object) -> str:
    """Return what of a skin is at the point."""
    if isinstance(skin, SheetSkin):
        return f"the middle cell {skin.landmarks[0].cell}"
    return "board (0, 0)"


def _refuse(
    options: argparse.Namespace, link: LinkSurfaces, choice: SkinChoice, boards: int | None, placed: Placement
) -> int:
    """Print why a skin does not fit, and the call for the nearest place where it does."""
    spot, words = placed.spot, "The nearest place where it fits is"
    for template, number in smaller(choice.template, boards):
        if found := nearest_place(link, template, number, spot):
            break
        words = "It fits nowhere that was tried on this link. The nearest place of a smaller one is"
    complain(
        f"{choice.text} does not fit at {millimetres(spot.point)}, the point of the mesh {spot.distance * 1e3:.1f} mm "
        f"from the given one: {placed.problem}"
    )
    if found:
        away = float(np.linalg.norm(np.subtract(found.spot.point, spot.point)))
        angle = np.degrees(np.arccos(np.clip(np.dot(found.spot.direction, spot.direction), -1, 1)))
        turned = f", turned by {angle:.0f} degrees" if angle > 1 else ""
        complain(f"{words} {away * 1e3:.1f} mm from there{turned}: {_command(options, template, number, found)}")
    else:
        complain("It fits nowhere that was tried on this link. Choose a smaller skin, or another place.")
    if options.picture:
        _draw(link, placed, found, options.picture)
    return WRONG_DATA


def _command(options: argparse.Namespace, template: SheetSkin | BoardSkin, boards: int | None, found: Placement) -> str:
    """Return the call that places a skin where it fits."""
    words = ["--on", ":".join(map(str, options.on))] if options.on else [str(options.mesh)]
    if isinstance(template, SheetSkin):
        lattice = template.lattice
        words += ["--sheet", f"{lattice.rows}x{lattice.columns}x{lattice.pitch[0] * 1e3:g}mm"]
    else:
        words += ["--hexagons", options.hexagons[0], *([] if boards is None else [str(boards)])]
    x, y, z = (f"{1e3 * value:.3f}".rstrip("0").rstrip(".") for value in found.spot.point)
    words += [f"--at={x},{y},{z}mm", f"--along={','.join(f'{value:g}' for value in found.spot.direction)}"]
    words += ["-o", str(options.output), *(["--unit", options.unit] if options.unit else [])]
    return shlex.join(["skin-calib", "new", *words])


def _draw(link: LinkSurfaces, placed: Placement, found: Placement | None, path: Path) -> None:
    """Draw a placement, and the nearest one that fits."""
    from ..pictures.placement import draw_placement  # it needs Matplotlib

    draw_placement(link.mesh, placed, found, path)


def _open(plan: Path) -> None:
    """Open a plan in Blender; print what to do without it."""
    blender = shutil.which("blender")
    if blender is None:
        complain("There is no program 'blender' on the search path. Open the plan with File > Import > Skin Plan.")
        return
    subprocess.Popen([blender, "--python-expr", IMPORT.format(str(plan.absolute()))])
