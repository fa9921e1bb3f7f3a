"""Cases of ``constants.py``: touches, responses, checks of calibration files, files of other programs."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from constant_cases import (
    PREPARATIONS,
    ROOT,
    SAMPLES,
    SHARED,
    Array,
    Result,
    case,
    command,
    numbers,
    warnings_in,
    write_csv,
)

AMOUNTS = (2.5e-10, 5e-10, 7e-10, 1.4e-9, 3e-9, 1e-6, 1e-2)  # of errors of surfaces, close to the limits of checks


@PREPARATIONS.append
def write_files(folder: Path) -> None:
    """Write calibrations with errors, measurements, and tables of taxels."""
    rng = np.random.default_rng(1)
    wrist = folder / "wrist.calibration.json"
    for k, amount in enumerate(AMOUNTS):
        perturbed(wrist, folder / f"perturbed_{k}.calibration.json", amount, rng)
    for k, rows in enumerate(measurements(rng)):
        write_csv(folder / f"measurements_{k}.csv", ("reading", "force"), rows)
    for k, rows in enumerate(taxel_tables(rng)):
        write_csv(folder / f"table_{k}.csv", ("x", "y", "z", "nx", "ny", "nz"), rows)


def perturbed(source: Path, target: Path, amount: float, rng: np.random.Generator) -> None:
    """Write a calibration with errors: of taxels, of all sizes; of the surface, of one size.

    Parameters
    ----------
    source, target : Path
    amount : float
        Error of the seam, of the domain of the knots, and of the order of mean, rms and maximum; relative.
    rng : Generator
        For errors of taxels, from 1e-12 to 3 times their values.
    """
    document = json.loads(source.read_text())
    taxels, surface = document["patches"][0]["taxels"], document["surfaces"][0]
    for key in ("normal", "tangent", "area", "position", "corners"):
        values = np.array(taxels[key], float)
        factors = 1 + 10.0 ** rng.uniform(-12, 0.5, len(values))
        taxels[key] = (values * factors.reshape(-1, *[1] * (values.ndim - 1))).tolist()
    net = np.array(surface["control_net"])
    net[0, 0] += amount * np.ptp(net, axis=(0, 1)).max()
    surface["control_net"] = net.tolist()
    surface["knots"][0] = [knot * (1 + amount) for knot in surface["knots"][0]]
    errors = surface["errors"]["surface_to_mesh"]
    errors["rms"] = errors["mean"] * (1 - amount)
    target.write_text(json.dumps(document))


def measurements(rng: np.random.Generator) -> Iterator[Array]:
    """Yield readings and forces: smooth, steep, saturated, with a dead zone, hysteresis, gaps, noise, and few."""
    forces = rng.uniform(0, 15, 400)
    exact = 255 * (1 - (1 - np.minimum(forces, 20) / 20) ** 3)
    for noise in (0.0, 0.5, 2.0, 8.0, 40.0):
        yield np.column_stack((np.clip(np.rint(exact + rng.normal(0, noise, 400)), 0, 255), forces))
    yield np.column_stack((np.clip(exact, 0, 215), forces))  # saturated
    yield np.column_stack((np.clip(exact - 60, 0, 255), forces))  # dead zone
    rising = np.arange(400) % 40 < 20
    for width in (1.0, 2.0, 4.0, 8.0):
        cycle = 7.5 - 7.5 * np.cos(np.arange(400) * np.pi / 20)
        yield np.column_stack((12 * cycle + np.where(rising, -width, width) + rng.normal(0, 0.5, 400), cycle))
    for gap in (0.05, 0.12, 0.3, 0.5):
        x = np.sort(rng.uniform(0, 1, 60))
        yield np.column_stack((200 * np.where(x < 0.5, x, x + gap), 10 * np.where(x < 0.5, x, x + gap) ** 2))
    for count in (4, 6, 8, 12, 18):
        yield np.column_stack((np.rint(np.linspace(0, 200, count)), np.linspace(0, 6, count) ** 1.3))
    x = np.linspace(0, 1, 300)
    yield np.column_stack((1000 * x, np.tanh(12 * (x - 0.3)) + 1 + 0.02 * rng.normal(size=300)))  # a table
    yield np.column_stack((1000 * x, 5 * np.sqrt(x) + 2e-9 * rng.normal(size=300)))


def taxel_tables(rng: np.random.Generator) -> Iterator[Array]:
    """Yield positions and normals: rounded, with equal positions, placeholders, lengths other than one, millimetres."""
    angle = np.linspace(0, 5, 60)
    outward = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    positions = 0.03 * outward + np.outer(np.arange(60), (0, 0, 0.001))
    for digits in (1, 2, 3, 4):
        yield np.hstack((positions, outward.round(digits)))
    for distance in 10.0 ** np.arange(-7.6, -4.4, 0.3):
        close = positions.copy()
        close[1::2] = close[::2] + distance * outward[::2]
        yield np.hstack((close, outward))
    yield np.hstack((positions, np.tile((1.0, 0.0, 0.0), (60, 1))))
    for flat in (0.03, 0.07, 0.15, 0.3):
        bumps = positions * (flat, 1, 1)
        yield np.hstack((bumps, np.tile((1.0, 0.0, 0.0), (60, 1))))
    for scale in (60.0, 110.0, 220.0, 1000.0):
        yield np.hstack((scale * positions, outward))


@case("touches", only=("skin", "validation", "pipeline", "common"))
def touches(folder: Path) -> Result:
    """Measured touches compared with the wrist sample, and the plan refined by them."""
    output = folder / "refined.plan.json"
    output.unlink(missing_ok=True)
    files = SAMPLES / "wrist.plan.json", ROOT / "examples" / "wrist_touches.csv"
    code, messages = command("touches", *files, "--refine", "-o", output)
    return {
        "exit code": code,
        **warnings_in(messages, folder),
        "numbers": numbers(messages.replace(str(folder), "")),
        "plan": numbers(output.read_text()) if output.exists() else np.zeros(0),
    }


@case("responses")
def responses(folder: Path) -> Result:
    """Responses fitted to measurements with noise, saturation, hysteresis and gaps, and to few measurements."""
    result: Result = {}
    for path in sorted(folder.glob("measurements_*.csv")):
        name, output = path.stem, path.with_suffix(".response.json")
        output.unlink(missing_ok=True)
        code, messages = command("response", folder / "wrist.calibration.json", path, "-o", output)
        result |= {f"exit code, {name}": code} | warnings_in(messages, folder, name)
        if output.exists():
            response = json.dumps(json.loads(output.read_text())["response"])
            result |= {f"kind, {name}": re.sub(r"[\d.e-]+", "#", response)[:40], f"response, {name}": numbers(response)}
    return result


@case("checks")
def checks(folder: Path) -> Result:
    """Findings in calibrations with errors of all sizes."""
    result: Result = {}
    for path in sorted(folder.glob("perturbed_*.json")):
        code, messages = command("check", path)
        result |= {f"exit code, {path.stem}": code, f"findings, {path.stem}": messages.splitlines()}
    return result


@case("tables of taxels")
def tables_of_taxels(folder: Path) -> Result:
    """Tables with rounded normals, equal positions, placeholders and other units."""
    result: Result = {}
    for path in sorted(folder.glob("table_*.csv")):
        back = folder / "table_read_again.txt"
        back.unlink(missing_ok=True)
        code, messages = command("import", path, "-o", back)
        result |= {f"exit code, {path.stem}": code, f"messages, {path.stem}": messages.splitlines()}
        result[f"text, {path.stem}"] = back.read_text() if back.exists() else ""
    return result


@case("other formats")
def other_formats(folder: Path) -> Result:
    """The wrist sample in each format, and read again."""
    from skin_calib_addon.calibration.exchange.formats import FORMATS

    result: Result = {}
    for name, form in FORMATS.items():
        path, back = folder / f"exported_{name}{form.ending}", folder / "read_again.csv"
        back.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        code, _ = command("export", folder / "wrist.calibration.json", "--to", name, "-o", path)
        is_text = path.exists() and form.ending != ".npz"
        text = path.read_bytes().decode("utf-8", "replace") if is_text else ""
        result |= {f"exit code, {name}": code, f"size, {name}": len(text), f"text, {name}": text}
        if form.readable and path.exists():
            code, messages = command("import", path, "--from", name, "-o", back)
            result |= {f"exit code, from {name}": code} | warnings_in(messages, folder, f"from {name}")
            result[f"text, from {name}"] = back.read_text() if back.exists() else ""
    return result


@case("recorded taxel files", real=True)
def recorded_files(folder: Path) -> Result:
    """Files of taxels that other programs wrote."""
    result: Result = {}
    for path in (SHARED / "taxels" / "raw" / "tum_patch2.xml", SHARED / "taxels" / "raw" / "icub_left_leg_upper.txt"):
        back = folder / "raw.csv"
        back.unlink(missing_ok=True)
        code, messages = command("import", path, "-o", back)
        result |= {f"exit code, {path.stem}": code} | warnings_in(messages, folder, path.stem)
        result[f"text, {path.stem}"] = back.read_text() if back.exists() else ""
    return result
