"""Run experiments with many seeds in parallel; tables, also in the documentation, and animations without a display."""

import argparse
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import mujoco
import numpy as np
from biped import Biped
from PIL import Image
from tqdm import tqdm

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out" / "control"
RESULTS = ROOT / "control" / "results"  # tables, which the pages of the documentation include
FRAME_TIME = 0.1  # between the frames of an animation [s]
SIZE = (360, 480)  # of an animation [pixel]
COLOURS = 64  # of an animation. More: larger files, and small things keep their colours
AMBIENT, DIFFUSE = 0.35, 0.5  # light of the camera, without which what it sees of a robot is mostly in the shade
Array = np.ndarray


def whole(text: str) -> int:
    """Return the number of an option that counts something; argparse reports the others."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


def positive(text: str) -> float:
    """Return the number of an option that is a size or a speed; argparse reports the others."""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 0 < value < np.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def folder(text: str) -> Path:
    """Return a folder that can be written, made if it is missing; argparse reports the others."""
    try:
        Path(text).mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=text):
            return Path(text)
    except OSError as error:
        raise argparse.ArgumentTypeError(f"cannot write to the folder {text}: {error.strerror}") from error


def arguments(description: str, has_animation: bool = True, seeds: int = 20) -> argparse.ArgumentParser:
    """Return the options of an experiment.

    Parameters
    ----------
    description : str
        Its first line is shown by ``--help``.
    has_animation : bool
        Whether the experiment makes one, which can be left out.
    seeds : int
        Number of runs of each case, unless ``--seeds`` gives another one.
    """
    parser = argparse.ArgumentParser(
        description=description.splitlines()[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--seeds", type=whole, default=seeds, help="number of runs with different noise")
    parser.add_argument("--jobs", type=whole, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--out", type=folder, default=str(OUT), help="folder of figures and animations")
    if has_animation:
        parser.add_argument("--no-animation", action="store_true", help="only the numbers and the figure")
    parser.add_argument("--write", action="store_true", help="the table into control/results/ and the documentation")
    parser.set_defaults(name=Path(parser.prog).stem)
    return parser


def run_all(
    work: Callable[[Any], Any], cases: Mapping[Any, Sequence[Any]], given: argparse.Namespace
) -> dict[Any, list[Any]]:
    """Return the results of the cases of each kind, with a progress bar."""
    flat = [case for some in cases.values() for case in some]
    try:
        with _mapped(work, flat, given.jobs) as results:
            found = iter(list(tqdm(results, total=len(flat))))
    except KeyboardInterrupt:
        raise SystemExit("stopped; nothing was written") from None
    return {kind: list(islice(found, len(some))) for kind, some in cases.items()}


@contextmanager
def _mapped(work: Callable[[Any], Any], cases: Sequence[Any], jobs: int) -> Iterator[Iterable[Any]]:
    if jobs == 1:
        yield map(work, cases)
    else:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the processes inherit it: this one reports Ctrl+C
        pool = get_context("spawn").Pool(jobs)
        signal.signal(signal.SIGINT, before)
        with pool:
            yield pool.imap(work, cases)


def spread(values: Iterable[float], digits: int = 0) -> str:
    """Return mean, and smallest to largest, as text; one number if all are the same."""
    known = np.array([value for value in values if np.isfinite(value)])
    if not len(known):
        return "none"
    rounded = (round(float(value), digits) + 0.0 for value in (known.mean(), known.min(), known.max()))  # no -0
    mean, low, high = (f"{value:.{digits}f}" for value in rounded)
    return mean if low == high else f"{mean} ({low} to {high})"


def distances(groups: Iterable[Array]) -> str:
    """Return mean, 95 % and maximum of all distances of some runs [m] as text [mm]."""
    far = 1e3 * np.concatenate(list(groups))
    return f"{np.nanmean(far):.1f} / {np.nanpercentile(far, 95):.1f} / {np.nanmax(far):.1f}"


def count(flags: Iterable[bool]) -> str:
    """Return how many of the flags are true, as text."""
    flags = list(flags)
    return f"{sum(flags)}/{len(flags)}"


def stands_and_steps(*groups: Sequence[Any]) -> list[str]:
    """Return how many walks of each group stand, and the steps of these walks, as texts."""
    return [text for runs in groups for text in (count(r.stands for r in runs), spread([r.steps for r in runs], 1))]


def report(given: argparse.Namespace, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown; with ``--write`` it replaces the one in the folder of the results."""
    heads = (f"{heads[0]} ({given.seeds} seeds)", *heads[1:])
    widths = [max(3, *map(len, column)) for column in zip(heads, *rows)]
    lines = [heads, ["-" * width for width in widths], *rows]
    table = "".join(f"| {' | '.join(map(str.ljust, line, widths))} |\n" for line in lines)
    print(table)
    if given.write:
        (RESULTS / f"{given.name}.md").write_text(table, "utf-8")


class Camera:
    """Records an animation of a robot.

    Parameters
    ----------
    robot : Biped
    azimuth, distance : float
        Of the view [degree, m].
    """

    def __init__(self, robot: Biped, azimuth: float = 130.0, distance: float = 2.2):
        robot.model.vis.headlight.ambient[:], robot.model.vis.headlight.diffuse[:] = AMBIENT, DIFFUSE
        self.renderer = mujoco.Renderer(robot.model, *SIZE)
        self.view, self.frames, self.next = mujoco.MjvCamera(), [], 0.0
        self.view.azimuth, self.view.elevation, self.view.distance = azimuth, -14, distance
        self.options = mujoco.MjvOption()
        self.options.sitegroup[:] = 0
        self.options.geomgroup[3] = 1

    def __call__(self, robot: Biped) -> None:
        """Take a frame if it is time for one."""
        if robot.data.time >= self.next:
            self.next += FRAME_TIME
            self.view.lookat[:] = (*robot.data.body("pelvis").xpos[:2], 0.6)
            self.renderer.update_scene(robot.data, self.view, self.options)
            self.frames.append(Image.fromarray(self.renderer.render()))

    def save(self, path: Path, colours: int = COLOURS) -> None:
        """Write a GIF."""
        path.parent.mkdir(parents=True, exist_ok=True)
        palette = self._palette(colours)
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self.frames]
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=int(1e3 * FRAME_TIME), loop=0)

    def _palette(self, colours: int) -> Image.Image:
        """Return a picture with the colours of the whole animation: some appear after its first frame."""
        some = self.frames[:: max(1, len(self.frames) // 8)]
        width, height = some[0].size
        joined = Image.new("RGB", (width, height * len(some)))
        for k, frame in enumerate(some):
            joined.paste(frame, (0, k * height))
        return joined.quantize(colours)


def film_both(
    runs: Sequence[Callable[[Callable[..., None]], Any]],
    path: Path,
    azimuth: float,
    distance: float = 2.2,
    every: int = 1,
) -> None:
    """Write two runs as one animation.

    Parameters
    ----------
    runs : sequence of two functions
        Each runs a case; its argument is to be called with the robot in each cycle.
    path : path
        Of the GIF.
    azimuth, distance : float
        Of the view [degree, m].
    every : int
        Of this many frames one is written.
    """
    cameras: list[Camera] = []
    for number, run in enumerate(runs):

        def film(robot: Biped, *_: Any, number: int = number) -> None:
            if len(cameras) == number:
                cameras.append(Camera(robot, azimuth, distance))
            cameras[number](robot)

        run(film)
    side_by_side(*cameras, path, every)


def side_by_side(left: Camera, right: Camera, path: Path, every: int = 1, colours: int = COLOURS) -> None:
    """Write two animations as one, the shorter of which stands still at its end."""
    count = max(len(left.frames), len(right.frames))
    joined = Camera.__new__(Camera)
    joined.frames = []
    for k in range(0, count, every):
        pair = [camera.frames[min(k, len(camera.frames) - 1)] for camera in (left, right)]
        picture = Image.new("RGB", (2 * SIZE[1], SIZE[0]))
        picture.paste(pair[0], (0, 0))
        picture.paste(pair[1], (SIZE[1], 0))
        joined.frames.append(picture)
    joined.save(path, colours)
