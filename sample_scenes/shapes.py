"""Analytic shapes of the sample scenes: the true surface is known, and they have no other author."""

import numpy as np
import trimesh


def tube_mesh(point, around, along):
    """Return the triangle mesh of ``point(angle, height)`` over all angles and heights; faces point outward."""
    angle, height = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(0, 1, along))
    vertices = point(angle.ravel(), height.ravel())
    a, b = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    p, q = (a * around + b).ravel(), (a * around + (b + 1) % around).ravel()
    r, s = p + around, q + around
    faces = np.concatenate((np.column_stack((p, q, s)), np.column_stack((p, s, r))))
    return trimesh.Trimesh(vertices, faces, process=False)


def wrist():
    """Return a tapered tube of 100 mm on a curved axis, oval with a ridge and a hollow; all sections differ."""

    def point(angle, height):
        a, b = 0.0375 - 0.0025 * height, 0.0310 - 0.0015 * height
        radius = a * b / np.hypot(b * np.cos(angle), a * np.sin(angle))
        radius *= 1 + 0.02 * np.cos(3 * angle + 0.6 + height) + 0.008 * np.cos(5 * angle - 1.0)
        for size, at_angle, at_height, width in ((0.0016, 1.1, 0.62, 0.013), (-0.0012, 3.9, 0.45, 0.012)):
            turn = np.angle(np.exp(1j * (angle - at_angle))) * 0.034
            radius += size * np.exp(-(turn**2 + (0.1 * (height - at_height)) ** 2) / (2 * width**2))
        x = 0.004 * np.sin(np.pi * height) + radius * np.cos(angle)
        y = 0.002 * height**2 + radius * np.sin(angle)
        return np.column_stack((x, y, 0.1 * height))

    return tube_mesh(point, 100, 52)


def edge():
    """Return a tube of 120 mm with a D-shaped section: a half circle and a flat side, with two sharp edges."""
    arc = np.linspace(-0.6 * np.pi, 0.6 * np.pi, 73)
    curve = 0.035 * np.column_stack((np.cos(arc), np.sin(arc)))
    flat = curve[-1] + np.linspace(0, 1, 25)[1:-1, None] * (curve[0] - curve[-1])
    outline = np.concatenate((curve, flat))

    def point(angle, height):
        i = np.rint(angle / (2 * np.pi) * len(outline)).astype(int) % len(outline)
        taper = (1 - 0.12 * height)[:, None]
        return np.column_stack((outline[i] * taper, 0.12 * height))

    return tube_mesh(point, len(outline), 31)


def sole():
    """Return the underside of a foot, 250 x 100 mm: rounded outline, 4 mm of curvature, a rim that bends up."""
    rings, around = 40, 160
    radii = np.concatenate((np.linspace(0, 1, rings - 8) ** 0.8, np.ones(8)))
    rim_heights = np.concatenate((np.zeros(rings - 8), np.linspace(0, 0.012, 9)[1:]))
    angle = np.arange(around) * 2 * np.pi / around
    c, s = np.cos(angle), np.sin(angle)
    power = (np.abs(c) ** 3.2 + np.abs(s) ** 3.2) ** (-1 / 3.2)  # between an ellipse and a rectangle
    x, y = 0.125 * power * c, (0.050 - 0.006 * c) * power * s
    vertices = [(0.0, 0.0, -0.004)]
    for part, up in zip(radii[1:], rim_heights[1:]):
        ring = np.column_stack((x * part, y * part, np.full(around, -0.004 * (1 - part**2) + up)))
        vertices += [tuple(v) for v in ring]
    faces = [(0, 1 + (k + 1) % around, 1 + k) for k in range(around)]
    for ring in range(rings - 2):
        for k in range(around):
            p, q = 1 + ring * around + k, 1 + ring * around + (k + 1) % around
            faces += [(p, q, q + around), (p, q + around, p + around)]
    return trimesh.Trimesh(np.array(vertices), np.array(faces), process=False)
