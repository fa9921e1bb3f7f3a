"""Feel places of contact in the simulator Genesis: a probe of its kind for each taxel.

    python examples/probes_genesis.py CALIBRATION MODEL.xml [--presses N]

The model is made by ``skin-calib export CALIBRATION --to newton -o MODEL.xml``. A sphere presses on random places of
random cells. Probes of Genesis measure how deep a body is in a sphere around the taxel: they give the place of a
contact, not its force. It needs ``pip install genesis-world`` (4 GB), and builds for minutes at its first run.
"""

import argparse

import genesis
import numpy as np

from skin_calib_addon.runtime import load

RADIUS, DEPTH = 0.004, 0.0003  # of the sphere, and of its press [m]
MARGIN = 0.2  # of a cell, in which it is not pressed: there the neighbour is as right
# Of the probes, as a multiple of the radius of the cell: to the corners of a square. Larger: places move to the middle
# of the skin; smaller: to the nearest taxel.
OVERLAP = 1.3


def main():
    """Press, and print how far the places are that the probes felt from those of the solver."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("calibration")
    parser.add_argument("model")
    parser.add_argument("--presses", type=int, default=50)
    given = parser.parse_args()

    skin, rng = load(given.calibration), np.random.default_rng(0)
    genesis.init(backend=genesis.cpu, precision="64", logging_level="error")
    scene = genesis.Scene(sim_options=genesis.options.SimOptions(dt=1e-3, gravity=(0, 0, 0)), show_viewer=False)
    link = scene.add_entity(genesis.morphs.MJCF(file=given.model))
    sphere = scene.add_entity(genesis.morphs.Sphere(radius=RADIUS))
    radii = np.sqrt(skin.areas / np.pi)
    probes = scene.add_sensor(
        genesis.sensors.ContactDepthProbe(
            entity_idx=link.idx, probe_local_pos=skin.positions.tolist(), probe_radius=(OVERLAP * radii).tolist()
        )
    )
    scene.build()

    distances, right = [], 0
    for k in rng.integers(len(skin.ids), size=given.presses):
        along = rng.normal(size=3)
        along -= (along @ skin.normals[k]) * skin.normals[k]
        along *= (1 - MARGIN) * radii[k] * np.sqrt(rng.uniform()) / np.linalg.norm(along)
        sphere.set_pos(skin.positions[k] + along + (RADIUS - DEPTH) * skin.normals[k])
        sphere.zero_all_dofs_velocity()
        scene.step()
        depths, contacts = probes.read().numpy(), sphere.get_contacts()
        places = contacts["position"].numpy()
        if len(places) == 0 or depths.sum() == 0:
            continue
        place = places[np.linalg.norm(contacts["force_a"].numpy(), axis=1).argmax()]
        nearest = np.linalg.norm(skin.positions - place, axis=1).argmin()
        right += depths.argmax() == nearest
        distances.append(np.linalg.norm(depths @ skin.positions / depths.sum() - place))
    print(f"{len(distances)} of {given.presses} presses felt, {right} by the nearest taxel")
    print(f"place: {1e3 * np.mean(distances):.2f} mm (at most {1e3 * np.max(distances):.2f}) from the solver's")


if __name__ == "__main__":
    main()
