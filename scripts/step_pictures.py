"""Make the pictures of docs/tutorial/blender.md from the screenshots of the window's driver.

../shared/blender/drive-gui --install . --size 1000x1150 --out gui-out tests/gui/drive_steps.py
python scripts/step_pictures.py gui-out
"""

import sys
from pathlib import Path

from PIL import Image

STEPS = Path(__file__).resolve().parents[1] / "docs" / "steps"
WIDTH = 560  # [pixel]
COLOURS = 64


def small(path: Path) -> Image.Image:
    """Return a screenshot with the width of the manual."""
    shot = Image.open(path).convert("RGB")
    return shot.resize((WIDTH, round(shot.height * WIDTH / shot.width)), Image.Resampling.LANCZOS)


def main() -> None:
    """Convert the screenshot of each step."""
    for path in sorted(Path(sys.argv[1]).glob("[0-9]_*.png")):
        small(path).quantize(COLOURS).save(STEPS / path.name, optimize=True)
        print(STEPS / path.name)


if __name__ == "__main__":
    main()
