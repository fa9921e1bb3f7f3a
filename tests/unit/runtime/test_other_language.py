"""The recipe for other languages, of ``docs/reference/runtime.md``, gives the results of the runtime."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull, HalfspaceIntersection

from skin_calib_addon.calibration import Response, save_calibration
from skin_calib_addon.runtime import load
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

ON, OFF = 1.5, 1.0  # [N]


@pytest.fixture
def path(tmp_path):
    """Write the file of a sole with a curved response and a range that begins above zero."""
    response = Response((-0.1, 0.02, 0.0004), (5.0, 255.0))
    sole = small_calibration(link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=response, extra={})
    save_calibration(sole, tmp_path / "sole.json")
    return tmp_path / "sole.json"


class Recipe:
    """A controller that knows the calibration file and the page only."""

    def __init__(self, path):
        document = json.loads(path.read_text())
        taxels = {}
        for patch in document["patches"]:
            for name, rows in patch["taxels"].items():
                taxels[name] = taxels.get(name, []) + rows
        self.p, self.n, self.corners = (np.array(taxels[name]) for name in ("position", "normal", "corners"))
        self.channel, ids, neighbours = np.array(taxels["channel"]), taxels["id"], taxels["neighbours"]
        row = {name: i for i, name in enumerate(ids)}
        self.neighbours = [[row[name] for name in names] for names in neighbours]
        self.w = np.hstack((-self.n, np.cross(self.p, -self.n)))
        self.response = document["response"]
        self.on = np.zeros(len(ids), bool)

    def rest(self, readings):
        self.b = self.response["range"][0] - readings[:, self.channel].mean(axis=0)

    def cycle(self, reading):
        readings = np.clip(reading[self.channel] + self.b, *self.response["range"])
        f = np.maximum(0.0, np.polyval(self.response["coefficients"][::-1], readings))
        self.on = f >= np.where(self.on, OFF, ON)
        contacts, free = [], set(np.flatnonzero(self.on).tolist())
        while free:
            found = [min(free)]
            for i in found:
                free.discard(i)
                found += [j for j in self.neighbours[i] if j in free and j not in found]
            contacts.append(self.position(np.array(found), f[found]))
        f = f[self.on]
        wrench, cop = f @ self.w[self.on], f @ self.p[self.on][:, :2] / f.sum()
        outer = ConvexHull(self.corners[self.on][:, :, :2].reshape(-1, 2))
        edges = ConvexHull(self.p[self.on][:, :2]).equations  # rows (a, -b)
        q = self.corners[0, :, :2] - self.p[0, :2]  # all cells are equal
        edges[:, 2] += (-q @ edges[:, :2].T).max(axis=0)
        guaranteed = ConvexHull(HalfspaceIntersection(edges, cop).intersections)
        return contacts, wrench, cop, outer.volume, guaranteed.volume

    def position(self, rows, f):
        p, n, F = self.p[rows], self.n[rows], f.sum()
        c, m, s = f @ p / F, f @ n / F, f @ (n * p).sum(axis=1) / F
        length = np.linalg.norm(m)
        return F, c + (s - m @ c) / (1 + length) * m / length


def test_recipe_gives_the_results_of_the_runtime(path):
    """With baseline and own thresholds: contacts, wrench, CoP, and the polygons of each frame."""
    rng = np.random.default_rng(3)
    recipe, skin = Recipe(path), load(path, ON, OFF)
    rest = rng.normal(20.0, 1.0, (19, 42))
    recipe.rest(rest)
    skin.tare(rest, accept=True)
    for k in range(6):
        reading = rng.normal(20.0, 1.0, 42)
        reading[10 + k : 30 + k] += rng.uniform(20, 60, 20)  # some are between the thresholds
        reading[0] += 60.0
        contacts, wrench, cop, outer, guaranteed = recipe.cycle(reading)
        frame = skin.update(reading, 0.004 * k)
        assert [c.force for c in frame.contacts] == pytest.approx([force for force, _ in contacts])
        for contact, (_, position) in zip(frame.contacts, contacts, strict=True):
            assert_allclose(contact.position, position, atol=1e-12)
        assert_allclose(frame.wrench, wrench, atol=1e-12)
        assert_allclose(frame.cop, cop, atol=1e-12)
        assert (frame.polygon.outer.area, frame.polygon.guaranteed.area) == pytest.approx((outer, guaranteed))
