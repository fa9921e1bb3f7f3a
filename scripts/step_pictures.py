"""Make the pictures of the window in the documentation from the screenshots of its drivers.

python scripts/make_extension.py --platform linux-x64 --without-wheels    # it prints the path of the ZIP
../shared/blender/drive-gui --size 1000x1150 --out out/steps tests/gui/drive_steps.py ZIP
../shared/blender/drive-gui --install . --size 1200x1300 --out out/cut --blend sample_scenes/wrist.blend \
    tests/gui/drive_cut.py
../shared/blender/drive-gui --install ZIP --size 800x900 --out out/film --blend sample_scenes/wrist.blend \
    tests/gui/drive_film.py
python scripts/step_pictures.py out

The parts of ``drive_real_links.py`` have folders in ``out/real``. The other drivers are called as ``drive_cut.py``.
A driver without screenshots in the folder is left out.
"""

import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

DOCS = Path(__file__).resolve().parents[1] / "docs"
WIDTH = 560  # of a step of the tutorial [pixel]
COLOURS = 256
# Picture in docs/: screenshot, and the part of it: left, top, right, lower edge [pixel].
PARTS = {
    "cut.png": ("cut/five_cuts.png", (30, 80, 985, 1180)),
    "planes.png": ("planes/followed.png", (180, 80, 985, 1060)),
    "live.png": ("live/dragged.png", (180, 80, 985, 772)),
    "imported.png": ("imported/found.png", (60, 80, 985, 1180)),
    "inspect.png": ("inspect/playing.png", (60, 80, 985, 1180)),
    "robot_in_blender.png": ("robot/robot_fitted.png", (400, 20, 1318, 814)),
}
PART_WIDTH = 720  # [pixel]

# Part of the film: words below its pictures, time of each picture and of the last one [ms].
FILM = {
    "link": ("1  The mesh of a link", 0, 1500),
    "surface": ("2  Fit: a smooth surface, 0.005 mm from the mesh", 0, 2000),
    "drag": ("3  Drag the sheet: taxels and normals follow", 180, 700),
    "press": ("4  Press: contact and force in the frame of the link", 180, 1200),
}
FILM_PART, FILM_SIZE, FILM_WORDS, FILM_COLOURS = (0, 56, 654, 786), (600, 670), 34, 96  # [pixel]


def small(picture: Image.Image, width: int) -> Image.Image:
    """Return a picture with a width [pixel], and few colours."""
    height = round(picture.height * width / picture.width)
    return picture.resize((width, height), Image.Resampling.LANCZOS).quantize(
        COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4
    )


def film(folder: Path) -> None:
    """Join the pictures of the film, with words below."""
    pictures, times = [], []
    font = ImageFont.load_default(FILM_WORDS * 0.62)
    paths = sorted(folder.glob("[0-9]*.png"))
    for path, following in zip(paths, [*paths[1:], None]):
        part = path.stem.split("_")[1]
        words, time, last = FILM[part]
        picture = Image.new("RGB", (FILM_SIZE[0], FILM_SIZE[1] + FILM_WORDS), "white")
        picture.paste(Image.open(path).convert("RGB").crop(FILM_PART).resize(FILM_SIZE, Image.Resampling.LANCZOS))
        ImageDraw.Draw(picture).text((10, FILM_SIZE[1] + FILM_WORDS // 2), words, "black", font, anchor="lm")
        pictures.append(picture)
        times.append(time if following is not None and part in following.stem else last)
    all_ = Image.new("RGB", (FILM_SIZE[0], FILM_SIZE[1] * len(pictures)))
    for k, picture in enumerate(pictures):
        all_.paste(picture, (0, FILM_SIZE[1] * k))
    palette = all_.quantize(FILM_COLOURS, kmeans=2)
    pictures = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    pictures[0].save(
        DOCS / "film.gif", save_all=True, append_images=pictures[1:], duration=times, loop=0, optimize=True
    )
    print(DOCS / "film.gif")


def main() -> None:
    """Convert the screenshots of each driver in the folder."""
    folder = Path(sys.argv[1])
    made = {f"steps/{path.name}": (path, None, WIDTH) for path in folder.glob("steps/[0-9]_*.png")}
    made |= {f"real/{path.name}": (path, None, WIDTH) for path in folder.glob("real/*/[0-9]_*.png")}
    made |= {name: (folder / shot, part, PART_WIDTH) for name, (shot, part) in PARTS.items()}
    for name, (path, part, width) in sorted(made.items()):
        if path.exists():
            small(Image.open(path).convert("RGB").crop(part), width).save(DOCS / name, optimize=True)
            print(DOCS / name)
    if any(folder.glob("film/[0-9]*.png")):
        film(folder / "film")


if __name__ == "__main__":
    main()
