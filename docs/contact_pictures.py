#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: contact_pictures.py: draws pictures of contacts: docs/patch.svg, docs/normals.svg, docs/sweep.svg, docs/speculative.svg,
docs/shapes.svg and docs/blocks_of_a_body.svg of what the Python module finds, docs/smooth_ground.svg of runs of ./run demo terrain.

Needs ./run python, ./run build demo_terrain and Debian's package glmark2-data; run it with PYTHONPATH=build/release/python."""

import csv
import subprocess
import tempfile
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


def normals():
    """A box whose corner has sunk into the edge of another box: contacts by the nearest surface alone, and those that count."""
    def body(size):
        mesh = bilayer.box(size)
        return bilayer.Collider(mesh, bilayer.build(mesh, voxel_size=0.05, half_width_voxels=5))

    ground, box, angle = body((2, 1, 1)), body((0.8, 0.5, 0.8)), 0.3
    pose = bilayer.Pose((0.95, 0.70, 0), (np.cos(angle / 2), 0, 0, np.sin(angle / 2)))
    found = [bilayer.collide(box, pose, ground, None, margin=0.05, min_normal_cosine=cosine, min_normal_cosine_apart=apart,
                             keep_oblique_edges=cosine < 0) for cosine, apart in ((-2, -2), (0.3, 0.9))]

    def arrows(contacts, colour):
        seen = {(round(x, 2), round(y, 2), round(nx, 2), round(ny, 2)) for (x, y, _), (nx, ny, nz)
                in zip(contacts.position, contacts.normal) if abs(nz) < 0.5}
        return [f'<path d="M{x} {y}l{0.12 * nx:.3f} {0.12 * ny:.3f}" stroke="{colour}" stroke-width=".008"/>'
                f'<circle cx="{x}" cy="{y}" r=".014" fill="{colour}"/>' for x, y, nx, ny in sorted(seen)]

    svg("normals.svg", 600, 330, ['<g transform="translate(130 330) scale(280 -280)">',
        f'<rect x="-1" y="-.5" width="2" height="1" fill="{GROUND}" stroke="{DARK}" stroke-width=".007"/>',
        f'<g transform="translate(.95 .7) rotate({np.degrees(angle):.1f})"><rect x="-.4" y="-.25" width=".8" height=".5" fill="{BODY}" '
        'fill-opacity=".7" stroke="#b5651d" stroke-width=".007"/></g>', *arrows(found[0], GREY), *arrows(found[1], RED), "</g>",
        label(20, 30, "normals of the nearest surface: left out", "#6d8498"), label(20, 50, "normals of contacts that count", RED)])


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


def speculative():
    """A ball that moves by more than its diameter in a step: where it starts, its contacts on the way, where it would end."""
    mesh, outline = hill()
    ground = bilayer.Collider(mesh, bilayer.build(mesh, voxel_size=0.04, half_width_voxels=6))
    radius, start, motion = 0.35, np.array([-1.2, 1.6]), np.array([1.1, -1.9])
    ball = bilayer.sphere(radius)
    body = bilayer.Collider(ball, bilayer.build(ball, voxel_size=0.05, half_width_voxels=4))
    found = bilayer.collide(body, bilayer.Pose((*start, 0)), ground, None, margin=0.04, motion_a=np.array([[*motion, 0], [0, 0, 0]]))

    def at(x, y):
        return 320 + 75 * x, 190 - 75 * y

    def circle(centre, style):
        return '<circle cx="{:.1f}" cy="{:.1f}" r="{:.1f}" {}/>'.format(*at(*centre), 75 * radius, style)

    drawn = ['<path d="M' + "L".join("{:.1f} {:.1f}".format(*at(*point)) for point in outline) + f'z" fill="{GROUND}" stroke="{DARK}"/>',
             circle(start + motion, f'fill="none" stroke="{GREY}" stroke-width="2" stroke-dasharray="6 4"'),
             circle(start, f'fill="{BODY}" stroke="#b5651d"')]
    for place, normal, distance in zip(found.position[:, :2], found.normal[:, :2], found.distance):
        (x, y), (u, v) = at(*place), at(*(place - motion * distance / -normal.dot(motion)))
        drawn.append(f'<path d="M{u:.1f} {v:.1f}L{x:.1f} {y:.1f}" stroke="{GREY}"/><circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{RED}"/>')
    svg("speculative.svg", 640, 300, [*drawn, label(20, 30, "a fast ball at the start of a step"),
        label(20, 50, f"its {len(found)} speculative contacts", RED), label(430, 60, "dashed: the step\'s end")])


def hill():
    """A body with a curved top: the area under a curve, extruded along z."""
    x = np.linspace(-4, 4, 161)
    top = 0.45 * np.sin(1.4 * x) - 0.25 * np.cos(0.6 * x)
    outline = np.concatenate([np.stack([x, top], 1), [[4, -1.2], [-4, -1.2]]])
    count, half = len(x), 0.6
    vertices = np.concatenate([np.column_stack([outline, np.full(len(outline), z)]) for z in (-half, half)])
    n = len(outline)
    side = [(i, (i + 1) % n) for i in range(n)]
    faces = [f for a, b in side for f in ((a, a + n, b), (b, a + n, b + n))]
    bottom = [(count + 1) if i < count // 2 else count for i in range(count - 1)]  # a fan from either lower corner
    fans = [(i, i + 1, c) for i, c in enumerate(bottom)] + [(count // 2, count, count + 1)]
    faces += [(a, b, c) for a, b, c in fans] + [(a + n, c + n, b + n) for a, b, c in fans]
    return bilayer.Mesh(vertices.astype(np.float32), np.array(faces, np.int32)), outline


def shapes():
    """Shapes that penetrate a field by a little, from the side, with their contacts and normals."""
    mesh, outline = hill()
    assert bilayer.inspect(mesh).closed and bilayer.inspect(mesh).oriented
    ground = bilayer.Collider(mesh, bilayer.build(mesh, voxel_size=0.04, half_width_voxels=6))
    kinds = [("sphere", bilayer.Shape.sphere(0.4), -3.1, 0, "M-0.4 0a.4 .4 0 1 0 .8 0a.4 .4 0 1 0 -.8 0"),
             ("capsule", bilayer.Shape.capsule(0.25, 0.4), -1.6, 1.2, "M-.25 -.4v.8a.25 .25 0 0 0 .5 0v-.8a.25 .25 0 0 0 -.5 0"),
             ("box", bilayer.Shape.box((0.45, 0.25, 0.4)), -0.1, 0.15, "M-.45 -.25h.9v.5h-.9z"),
             ("cylinder", bilayer.Shape.cylinder(0.3, 0.4), 1.5, 0.1, "M-.3 -.4h.6v.8h-.6z"),
             ("cone", bilayer.Shape.cone(0.4, 0.4), 3.0, 2.2, "M-.4 -.4h.8l-.4 .8z")]
    drawn = ['<path d="M' + " L".join(f"{x:.3f} {y:.3f}" for x, y in outline) + f'Z" fill="{GROUND}" stroke="{DARK}" stroke-width=".02"/>']
    marks, labels = [], []
    for name, shape, x, angle, path in kinds:
        turned = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
        gap = 1.0
        height = 2.5
        while gap > -0.02:  # lowered until it penetrates by half a voxel
            height -= max(gap, 0) + 0.005
            gap = bilayer.distance(shape, bilayer.Pose((x, height, 0), turned), ground, None).distance
        found = bilayer.collide(shape, bilayer.Pose((x, height, 0), turned), ground, None, margin=0.04)
        drawn.append(f'<path d="{path}" transform="translate({x} {height:.3f}) rotate({np.degrees(angle):.1f})" fill="{BODY}" '
                     f'fill-opacity=".8" stroke="#b5651d" stroke-width=".02"/>')
        for (px, py, _), (nx, ny, _) in zip(found.position, found.normal):
            marks.append(f'<path d="M{px:.3f} {py:.3f}l{0.3 * nx:.3f} {0.3 * ny:.3f}" stroke="{RED}" stroke-width=".015"/>'
                         f'<circle cx="{px:.3f}" cy="{py:.3f}" r=".03" fill="{RED}"/>')
        labels.append(label(340 + 80 * x - 4 * len(name), 30, name) + label(340 + 80 * x - 4 * len(name), 48, f"{len(found)} contacts", RED))
    svg("shapes.svg", 680, 300, ['<g transform="translate(340 195) scale(80 -80)">', *drawn, *marks, "</g>", *labels])


def blocks_of_a_body():
    """A cut through a bunny on a floor: the blocks of its field, its surface, and its contacts with the floor and with a ball."""
    mesh = bilayer.read_mesh("/usr/share/glmark2/models/bunny.obj")
    level_set = bilayer.build(mesh, resolution=64)
    bunny, spacing = bilayer.Collider(mesh, level_set), level_set.voxel_size
    height = -mesh.vertices[:, 1].min() - 0.3 * spacing
    radius, pose = 0.25, bilayer.Pose((0, height, 0))
    ball, cut = np.array([0.55, 2, 0]), 0.0
    for _ in range(20):  # let down on the back, and moved along z to where it touches: the cut is there
        ball[1:] = 2, cut
        while (gap := bilayer.distance(bilayer.Shape.sphere(radius), bilayer.Pose(ball), bunny, pose)).distance > -0.2 * spacing:
            ball[1] -= max(gap.distance, 0) + 0.05 * spacing
        cut = float(gap.position_b[2])

    def at(x, y):
        return 300 + 170 * x, 400 - 170 * y

    blocks = np.unique(np.floor_divide(level_set.sparse().coordinates, 8), axis=0)
    middle = int(np.floor((cut / spacing + 0.5) / 8))
    drawn = [f'<rect x="0" y="400" width="600" height="40" fill="{GROUND}"/>']
    for i, j, _ in blocks[blocks[:, 2] == middle]:
        x, y = at((8 * i - 0.5) * spacing, (8 * j + 7.5) * spacing + height)
        drawn.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{170 * 8 * spacing:.1f}" height="{170 * 8 * spacing:.1f}" fill="none" stroke="{GREY}"/>')
    for a, b, c in mesh.vertices[mesh.faces]:  # where triangles meet the plane of the cut
        ends = [p + (q - p) * (cut - p[2]) / (q[2] - p[2]) for p, q in ((a, b), (b, c), (c, a)) if (p[2] < cut) != (q[2] < cut)]
        if len(ends) == 2:
            (x0, y0), (x1, y1) = (at(x, y + height) for x, y, _ in ends)
            drawn.append(f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="{DARK}" stroke-width="1.5"/>')
    x, y = at(ball[0], ball[1])
    drawn.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{170 * radius:.1f}" fill="{BODY}" fill-opacity=".7" stroke="#b5651d"/>')
    count = 0
    for other, there in ((bilayer.Shape.plane((0, 1, 0), 0), None), (bilayer.Shape.sphere(radius), bilayer.Pose(ball))):
        found = bilayer.collide(bunny, pose, other, there, margin=0)
        count += len(found)
        for (px, py, _), (nx, ny, _) in zip(found.position, found.normal):
            x, y = at(px, py)
            drawn.append(f'<path d="M{x:.1f} {y:.1f}l{30 * nx:.1f} {-30 * ny:.1f}" stroke="{RED}" stroke-width="1.2"/>'
                         f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{RED}"/>')
    svg("blocks_of_a_body.svg", 600, 440, drawn + [label(20, 30, "the blocks of the field, in a cut"),
        label(20, 50, f"{count} contacts with a floor and a ball, and their normals", RED)])


def energies(*options):
    """Times, and the energy of six bodies that slide over waves of coarse triangles, as a part of that at the start."""
    program = DOCS.parent / "build" / "release" / "demo_terrain"
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "--height", "0.1", "--cell", "0.6", "--steps", "60", "--out", folder, *options]
        subprocess.run(command, stdout=subprocess.DEVNULL)  # the scene misses its criteria without smooth ground
        with open(Path(folder) / "terrain.csv") as file:
            rows = [(float(row["time_s"]), float(row["kinetic_J"]) + float(row["potential_J"])) for row in csv.DictReader(file)]
    settled = [row for row in rows if row[0] >= 0.25]
    return [(time, energy / settled[0][1]) for time, energy in settled]


def smooth_ground():
    """The energy of bodies that slide over waves without friction, with and without smooth ground."""
    left, bottom, wide, tall = 70, 240, 500, 200
    shapes = [f'<path d="M{left} {bottom - tall * share:.0f}h{wide}" stroke="{GROUND}"/>' for share in (0.25, 0.5, 0.75, 1)]
    shapes += [label(20, bottom + 5 - tall * share, f"{100 * share:.0f} %") for share in (0, 0.5, 1)]
    shapes += [f'<path d="M{left} {bottom}h{wide}" stroke="{DARK}"/>', label(left + wide - 20, bottom + 22, "3 s"), label(left, bottom + 22, "0")]
    for options, colour, text, at in (([], DARK, "with smoothGround", 0.9), (["--no-smooth-ground"], RED, "without", 0.68)):
        curve = [f"{left + wide * time / 3.25:.1f} {bottom - tall * energy:.1f}" for time, energy in energies(*options)]
        shapes += [f'<path d="M{"L".join(curve)}" fill="none" stroke="{colour}" stroke-width="2"/>', label(400, bottom - tall * at, text, colour)]
    svg("smooth_ground.svg", 600, 280, shapes + [label(left, 22, "energy of six bodies that slide over waves of triangles without friction")])


if __name__ == "__main__":
    patch()
    normals()
    sweep()
    speculative()
    shapes()
    blocks_of_a_body()
    smooth_ground()
