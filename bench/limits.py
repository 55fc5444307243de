#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What the command line makes of sizes at its limits: exit status, time, peak memory, last line.

Prints a table in Markdown. The meshes are made by formula, in a temporary folder of about 2 GB."""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

MILLIONS = 20  # triangles of the largest mesh
COMPONENTS = 100_000
NESTED = 2_000  # components in each other
GROWTH = 4  # sizes for each kind of mesh that would be slow if time grew with the square; each twice the one before
MAX_SECONDS = 600  # of processor time
TETRAHEDRON = (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def write_ply(path, points, triangles):
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + points.astype("<f4").tobytes() + faces.tobytes())
    return str(path)


def tetrahedra(path, places, sizes):
    """One tetrahedron of each size at each place."""
    points, triangles = TETRAHEDRON
    all_points = places[:, None, :] + sizes[:, None, None] * points
    all_triangles = triangles + 4 * np.arange(len(places))[:, None, None]
    return write_ply(path, all_points.reshape(-1, 3), all_triangles.reshape(-1, 3))


def octahedra(path, centres, sizes, opened=0):
    """Octahedra whose faces are divided into four each, without the last `opened` triangles of each."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    points, triangles = list(corners), []
    middle = lambda a, b: (points.append(np.array(a) + np.array(b)), len(points) - 1)[1]
    for signs in np.ndindex(2, 2, 2):
        a, b, c = (axis + 3 * sign for axis, sign in enumerate(signs))
        if sum(signs) % 2:
            b, c = c, b
        ab, bc, ca = (middle(corners[i] / np.sqrt(2), corners[k] / np.sqrt(2)) for i, k in ((a, b), (b, c), (c, a)))
        triangles += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    points, triangles = np.array(points), np.array(triangles)[: len(triangles) - opened]
    all_points = centres[:, None, :] + sizes[:, None, None] * points
    all_triangles = triangles + len(points) * np.arange(len(centres))[:, None, None]
    return write_ply(path, all_points.reshape(-1, 3), all_triangles.reshape(-1, 3))


def needles(path, start, count):
    """Long thin tetrahedra from a distance of the centre outward, in all directions."""
    along = np.random.default_rng(1).normal(size=(count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    u = np.cross(along, [0.3, 0.5, 0.8])
    u *= 0.2 / np.sqrt(count) / np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(along, u)
    points = np.stack([start * along, along + u, along - 0.5 * u + 0.8 * v, along - 0.5 * u - 0.8 * v], axis=1)
    all_triangles = TETRAHEDRON[1] + 4 * np.arange(count)[:, None, None]
    return write_ply(path, points.reshape(-1, 3), all_triangles.reshape(-1, 3))


def star(path, rays):
    """A flat closed star of two poles, whose rim goes in and out."""
    angle, radius = np.pi * np.arange(2 * rays) / rays, np.where(np.arange(2 * rays) % 2, 1.0, 0.02)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    i = np.arange(2 * rays)
    k, pole = np.roll(i, -1), np.full(2 * rays, 2 * rays)
    return write_ply(path, np.vstack([rim, [[0, 0, 0.1], [0, 0, -0.1]]]),
                     np.vstack([np.stack([i, k, pole], axis=1), np.stack([k, i, pole + 1], axis=1)]))


def cells(count):
    """Places on a lattice of the unit cube, and its spacing."""
    side = int(np.ceil(count ** (1 / 3)))
    return np.stack(np.unravel_index(np.arange(count), (side, side, side)), axis=1) / side, 1 / side


def shell(path, count):
    """One octahedron around many."""
    centres, spacing = cells(count)
    return octahedra(path, np.vstack([centres, [[0.5, 0.5, 0.5]]]), np.append(np.full(count, 0.3 * spacing), 4))


def growing(folder):
    """Kinds of meshes: a title, the first size, and a function of a path and a size."""
    zeros, sizes = lambda n: np.zeros((n, 3)), lambda n: 1 + np.arange(n) / n
    yield "octahedra in each other", 2_000, lambda path, n: octahedra(path, zeros(n), sizes(n))
    yield "open octahedra in each other", 2_000, lambda path, n: octahedra(path, zeros(n), sizes(n), opened=4)
    yield "octahedra in one", 10_000, shell
    yield "tetrahedra next to each other", 25_000, lambda path, n: tetrahedra(path, 2 * cells(n)[0], np.full(n, cells(n)[1]))
    yield "needles from one point", 4_000, lambda path, n: needles(path, 0, n)
    yield "needles from around a point", 4_000, lambda path, n: needles(path, 0.05, n)
    yield "rays of one star", 4_000, star
    yield "tetrahedra that share three planes", 250, lambda path, n: tetrahedra(path, zeros(n), sizes(n))


def meshes(folder):
    unit, one = np.zeros((1, 3)), np.ones(1)
    side = int(np.ceil(COMPONENTS ** (1 / 3)))
    lattice = np.stack(np.unravel_index(np.arange(COMPONENTS), (side, side, side)), axis=1) * 2.0
    random = np.random.default_rng(1).uniform(0, side, (COMPONENTS, 3))
    nested = 1 + np.arange(NESTED) / NESTED
    giant = folder / "giant.ply"
    subprocess.run([sys.executable, Path(__file__).with_name("giant_mesh.py"), str(MILLIONS), giant], check=True)
    far = np.array([[0, 0, 0], [1e30, 0, 0], [0, 1, 0], [0, 0, 1]])
    return {
        "small": tetrahedra(folder / "small.ply", unit, one),
        "giant": str(giant),
        "triangle": write_ply(folder / "triangle.ply", np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])),
        "large": tetrahedra(folder / "large.ply", unit, 1e30 * one),
        "tiny": tetrahedra(folder / "tiny.ply", unit, 1e-30 * one),
        "far": write_ply(folder / "far.ply", far, TETRAHEDRON[1]),
        "apart": tetrahedra(folder / "apart.ply", lattice, np.ones(COMPONENTS)),
        "crossing": tetrahedra(folder / "crossing.ply", random, np.ones(COMPONENTS)),
        "nested": tetrahedra(folder / "nested.ply", -0.2 * nested[:, None] * np.ones(3), nested),
    }


def cases(mesh):
    build = lambda name, *options: ["build", mesh[name], *options]
    yield "a tetrahedron, 7.6 * 10^9 voxels in the band", build("small", "--resolution", "23000")
    yield "the same as a liquid", ["seed", mesh["small"], "--resolution", "23000"]
    yield "a tetrahedron, resolution 10^6", build("small", "--resolution", "1000000")
    yield "the same in tiles", build("small", "--resolution", "1000000", "--tiles", "8x8x8", "--sign", "normals")
    yield "the same as a liquid", ["seed", mesh["small"], "--resolution", "1000000"]
    yield "a tetrahedron, resolution 10^9", build("small", "--resolution", "1000000000")
    yield f"{MILLIONS} million triangles", ["inspect", mesh["giant"]]
    yield "the same", build("giant", "--resolution", "512")
    yield "the same", build("giant", "--resolution", "512", "--sign", "winding")
    yield "the same, resolution 10^6", build("giant", "--resolution", "1000000")
    yield "one triangle, 10^9 voxels in its band", build("triangle", "--voxel-size", "5.5e-5")
    yield "the same", build("triangle", "--voxel-size", "5.5e-5", "--method", "double-layer")
    yield "one triangle of 10^9 voxels along an edge", build("large", "--voxel-size", "1e21")
    yield "half width 1000, resolution 20", build("small", "--resolution", "20", "--half-width", "1000")
    yield "half width 1000, resolution 1000", build("small", "--resolution", "1000", "--half-width", "1000")
    yield "half width 1001", build("small", "--resolution", "20", "--half-width", "1001")
    yield "coordinates of 1e30", build("large", "--resolution", "64")
    yield "the same", ["inspect", mesh["large"]]
    yield "one vertex at 1e30", build("far", "--resolution", "64")
    yield "the same", build("far", "--voxel-size", "0.01")
    yield "coordinates of 1e-30", build("tiny", "--resolution", "64")
    yield "the same", ["inspect", mesh["tiny"]]
    for name in ("apart", "crossing", "nested"):
        yield f"{NESTED if name == 'nested' else COMPONENTS:,} components, {name}", ["inspect", mesh[name]]
        yield "the same", build(name, "--resolution", "256")
        yield "the same", build(name, "--resolution", "256", "--body")
        yield "the same", build(name, "--resolution", "256", "--union")
        yield "the same as a liquid", ["seed", mesh[name], "--resolution", "256"]


def polygon(path, x, y):
    """One flat face with these corners, as OBJ."""
    corners = "".join(f"v {a:.6f} {b:.6f} 0\n" for a, b in zip(x, y))
    path.write_text(corners + "f " + " ".join(map(str, range(1, len(x) + 1))) + "\n")
    return str(path)


def zero_bytes(path):
    with open(path, "wb") as file:
        file.truncate(1 << 30)
    return str(path)


def hostile(folder):
    """Files that were made to cost much."""
    random = np.random.default_rng(1)
    at = lambda angle, radius: (radius * np.cos(angle), radius * np.sin(angle))
    yield "1 GiB of zero bytes, as .obj", ["inspect", zero_bytes(folder / "zero.obj")]
    yield "1 GiB of zero bytes, as .vdb", ["info", zero_bytes(folder / "zero.vdb")]
    star = polygon(folder / "star.obj", *at(np.linspace(0, 2 * np.pi, 20_000, endpoint=False), random.uniform(0.1, 1, 20_000)))
    yield "one polygon of 20,000 corners in a star", ["inspect", star]
    out = np.sqrt(np.linspace(1, 1000, 100_000)) * np.pi  # the angles of a spiral, which returns next to itself
    spiral = at(np.concatenate([out, out[::-1]]), np.concatenate([out, out[::-1] + 1]))
    yield "one polygon of 200,000 corners in a spiral", ["inspect", polygon(folder / "spiral.obj", *spiral)]
    crossing = polygon(folder / "crossing.obj", *random.random((2, 10_000)))
    yield "one polygon of 10,000 random corners, which crosses itself everywhere", ["build", crossing, "--resolution", "20"]
    yield "the same", ["inspect", crossing]
    yield "the same of 40,000 corners", ["inspect", polygon(folder / "larger.obj", *random.random((2, 40_000)))]


def measure(program, words, folder):
    if words[0] not in ("inspect", "info"):
        words = [*words, "-o", str(folder / ("tiles" if "--tiles" in words else "out.vdb"))]
    begin = time.monotonic()
    limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS))
    process = subprocess.Popen([program, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=limit)
    text = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.monotonic() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    processor = usage.ru_utime + usage.ru_stime
    return process.returncode, seconds, processor, usage.ru_maxrss / 1024, text.replace(f"{folder}/", "").strip().split("\n")[-1]


def measure_growth(program, folder):
    print("| input | components | `inspect` [s] |\n|---|---|---|")
    for title, first, make in growing(folder):
        counts = [first << i for i in range(GROWTH)]
        seconds = [f"{measure(program, ['inspect', make(folder / 'growing.ply', n)], folder)[1]:.2f}" for n in counts]
        print(f"| {title} | {', '.join(f'{n:,}' for n in counts)} | {', '.join(seconds)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", help="bilayer")
    parser.add_argument("chosen", nargs="*", help="measure only rows that have one of these words; growth: instead, how time grows; "
                        "hostile: instead, files that were made to cost much")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "growth" in arguments.chosen:
            return measure_growth(arguments.program, folder)
        rows = hostile(folder) if "hostile" in arguments.chosen else cases(meshes(folder))
        print("| input | command | status | time [s] | of processors [s] | memory [MiB] | last line |\n|---|---|---|---|---|---|---|")
        for title, words in rows:
            command = " ".join(words).replace(f"{name}/", "")
            wanted = [word for word in arguments.chosen if word != "hostile"]
            if wanted and not any(part in title + command for part in wanted):
                continue
            status, seconds, processor, memory, line = measure(arguments.program, words, folder)
            print(f"| {title} | `{command}` | {status} | {seconds:.1f} | {processor:.1f} | {memory:.0f} | {line} |", flush=True)


if __name__ == "__main__":
    main()
