"""Make the pictures of the window in the documentation from the screenshots of its drivers.

python scripts/make_extension.py --platform linux-x64 --without-wheels    # it prints the path of the ZIP
../shared/blender/drive-gui --size 1000x1150 --out out/steps tests/gui/drive_steps.py ZIP
../shared/blender/drive-gui --install . --size 1200x1300 --out out/cut --blend sample_scenes/wrist.blend \
    tests/gui/drive_cut.py
python scripts/step_pictures.py out

The parts of ``drive_real_links.py`` have folders in ``out/real``. The other drivers are called as ``drive_cut.py``.
A driver without screenshots in the folder is left out.
"""

import sys
from pathlib import Path

from PIL import Image

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


def small(picture: Image.Image, width: int) -> Image.Image:
    """Return a picture with a width [pixel], and few colours."""
    height = round(picture.height * width / picture.width)
    return picture.resize((width, height), Image.Resampling.LANCZOS).quantize(
        COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4
    )


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


if __name__ == "__main__":
    main()
