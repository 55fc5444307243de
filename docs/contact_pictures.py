#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: contact_pictures.py: draws docs/patch.svg and docs/sweep.svg, of contacts and a time of impact that the module finds.

Needs ./run python and Debian's package glmark2-data; run it with PYTHONPATH=build/release/python."""

from pathlib import Path

import bilayer
import numpy as np

DOCS = Path(__file__).parent
DARK, GREY, RED, BODY, GROUND = "#2b3a4a", "#9fb4c6", "#d1495b", "#f6dcc9", "#dfe7ee"


def svg(name, width, height, shapes):
    (DOCS / name).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="DejaVu Sans, Helvetica, Arial, sans-serif" '
        f'font-size="14">\n<rect width="{width}" height="{height}" fill="#fbfaf7"/>\n' + "\n".join(shapes) + "\n</svg>\n")


def label(x, y, text, colour=DARK):
    return f'<text x="{x}" y="{y}" fill="{colour}">{text}</text>'


def patch():
    """The contacts of a bunny that stands on a plane, seen from above: all of them, and those that are kept."""
    mesh = bilayer.read_mesh("/usr/share/glmark2/models/bunny.obj")
    bunny = bilayer.Collider(mesh, bilayer.build(mesh, resolution=64, interior_width_voxels=6, exterior_width_voxels=3))
    height = -mesh.vertices[:, 1].min()
    ground = bilayer.Shape.plane((0, 1, 0), 0)
    found = [bilayer.collide(bunny, bilayer.Pose((0, height, 0)), ground, None, margin=0.02, reduced=reduced) for reduced in (False, True)]

    def dots(contacts, radius, colour):
        return [f'<circle cx="{300 + 260 * x:.1f}" cy="{225 + 260 * z:.1f}" r="{radius}" fill="{colour}"/>' for x, _, z in contacts.position]

    shadow = np.unique((mesh.vertices[:, [0, 2]] * 32.5).round(), axis=0) * 8
    svg("patch.svg", 600, 450, [f'<circle cx="{300 + x:.0f}" cy="{225 + z:.0f}" r="6.5" fill="{GROUND}"/>' for x, z in shadow] +
        dots(found[0], 2.5, GREY) + dots(found[1], 5, RED) +
        [label(20, 30, f"a bunny on a floor, from above: {len(found[0])} contacts,"), label(20, 50, f"of which {len(found[1])} are kept", RED)])


def sweep():
    """A bar that turns while it flies against a wall: where it starts, where it touches, where the step would end."""
    length, thick = 60.0, 8.0
    mesh = bilayer.box((2 * length, 2 * thick, 2 * thick))
    bar = bilayer.Collider(mesh, bilayer.build(mesh, voxel_size=1, half_width_voxels=4))
    start, motion = bilayer.Pose((120, 130, 0)), np.array([[420, 20, 0], [0, 0, 2.6]])
    wall = bilayer.Shape.box((15, 110, 110))
    impact = bilayer.time_of_impact(bar, start, motion, wall, bilayer.Pose((400, 130, 0)), None)

    def drawn(fraction, fill, stroke):
        x, y = start.position[:2] + fraction * motion[0][:2]
        return (f'<rect x="{-length:.0f}" y="{-thick:.0f}" width="{2 * length:.0f}" height="{2 * thick:.0f}" fill="{fill}" stroke="{stroke}" '
                f'stroke-width="2" transform="translate({x:.1f} {y:.1f}) rotate({np.degrees(fraction * motion[1][2]):.1f})"/>')

    between = [drawn(f, "none", GREY) for f in np.linspace(0, impact.fraction, 5)[1:-1]]
    svg("sweep.svg", 640, 270, [f'<rect x="385" y="20" width="30" height="220" fill="{GROUND}" stroke="{DARK}" stroke-width="2"/>',
        *between, drawn(0, BODY, "#b5651d"), drawn(1, "none", GREY), drawn(impact.fraction, BODY, RED), label(60, 215, "start of the step"),
        label(215, 255, f"first touch, at {impact.fraction:.2f} of the step", RED), label(460, 255, "without it: the step's end")])


if __name__ == "__main__":
    patch()
    sweep()
