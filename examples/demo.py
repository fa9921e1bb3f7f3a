"""Run the main task on the sample by the command line, and, where its module is installed, by Blender without a window.

The results are ``out/wrist.calibration.json``, ``out/wrist.png`` and ``out/summary.txt``. ``out/contacts.txt`` has the
output of a controller for a recorded press. The demo fails if the calibrations of both differ.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SAMPLES, OUT = ROOT / "sample_scenes", ROOT / "out"


def run(*words):
    """Run a program and return its output; exit with its messages if it fails."""
    done = subprocess.run([sys.executable, *map(str, words)], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"demo: {Path(words[0]).name} failed ({done.returncode}):\n{done.stdout}{done.stderr}")
    return done.stdout


def main():
    """Fit the sample twice, compare the files, and print a summary."""
    OUT.mkdir(exist_ok=True)
    calibration, again = OUT / "wrist.calibration.json", OUT / "wrist.blender.json"
    fit = ("-m", "skin_calib_addon", "fit", SAMPLES / "wrist.plan.json", "-o", calibration)
    summary = run(*fit, "--picture", OUT / "wrist.png", "--report", OUT / "wrist.report.json")
    has_blender = importlib.util.find_spec("bpy") is not None
    if has_blender:
        run("examples/batch_fit.py", SAMPLES / "wrist.blend", "--", "-o", again)
        if calibration.read_bytes() != again.read_bytes():
            sys.exit(f"demo: {calibration} and {again} differ; all bytes must be equal")
        again.unlink()
    (OUT / "summary.txt").write_text(summary)
    (OUT / "contacts.txt").write_text(run("examples/controller.py", calibration, ROOT / "examples/wrist_recording.csv"))
    print(summary, end="")
    print("The calibration is out/wrist.calibration.json, the picture is out/wrist.png.")
    if has_blender:
        print("Blender made the same file, byte for byte.")
    else:
        print(
            "In Blender: make extension, drag the zip in dist/ into it, open sample_scenes/wrist.blend, tab Skin, Fit."
        )


if __name__ == "__main__":
    main()
