# SPDX-License-Identifier: Apache-2.0
"""Python packages on the same mesh and points: bilayer, Open3D, OpenVDB's module, scipy's cKDTree.

Times are the best of several runs. Errors and wrong signs are against brute force over all triangles in double
precision. Packages that are not installed are left out.
"""

import argparse
import importlib
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

import bilayer

BATCH = 64  # points that brute force takes at once
TREE_PART = 20  # the tree is asked about one in so many points: far ones take it long


def package(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name} is not installed: left out")
        return None


def best(repeats, call):
    """The shortest time, and the result."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
    return min(times), result


def squared_distance(points, a, b, c):
    """Squared distances of points (P, 1, 3) to triangles (T, 3): to the plane inside the prism, else to the edges."""
    def to_edge(start, end):
        along, offset = end - start, points - start
        t = np.clip((offset * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-300), 0, 1)
        gap = offset - t[..., None] * along
        return (gap * gap).sum(-1)

    normal = np.cross(b - a, c - a)
    area2 = (normal * normal).sum(-1)
    edges = np.minimum(np.minimum(to_edge(a, b), to_edge(b, c)), to_edge(c, a))
    above = np.ones(edges.shape, bool)
    for start, end in ((a, b), (b, c), (c, a)):
        above &= (np.cross(normal, end - start) * (points - start)).sum(-1) >= 0
    plane = ((points - a) * normal).sum(-1) ** 2 / np.maximum(area2, 1e-300)
    return np.where(above & (area2 > 0), np.minimum(plane, edges), edges)


def winding(points, a, b, c):
    """The winding number of points (P, 1, 3), by solid angles."""
    a, b, c = a - points, b - points, c - points
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    det = (a * np.cross(b, c)).sum(-1)
    div = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(det, div).sum(-1) / (2 * np.pi)


def brute_force(mesh, points):
    a, b, c = mesh.vertices.astype(float)[mesh.faces].transpose(1, 0, 2)
    result = []
    for part in np.array_split(points.astype(float)[:, None], max(1, len(points) // BATCH)):
        for point in part[:, None]:
            distance = np.sqrt(squared_distance(point, a, b, c).min())
            result.append(-distance if winding(point, a, b, c)[0] > 0.5 else distance)
    return np.array(result)


def make_points(mesh, count, random):
    """Half within 2 % of the surface, half in 1.5 times the bounds; shuffled."""
    lower, upper = mesh.bounds
    size = (upper - lower).max()
    corners = mesh.vertices[mesh.faces[random.integers(len(mesh.faces), size=count // 2)]]
    near = (corners * random.dirichlet((1, 1, 1), size=len(corners))[:, :, None]).sum(axis=1)
    near += random.normal(scale=0.02 * size, size=near.shape)
    centre, half = (lower + upper) / 2, 0.75 * (upper - lower)
    uniform = random.uniform(centre - half, centre + half, size=(count - len(near), 3))
    return random.permutation(np.concatenate([near, uniform])).astype(np.float32)


class Table:
    def __init__(self, truth, size, count):
        self.truth, self.size, self.count = truth, size, count
        print(f"{'':44}{'seconds':>10}{'per million':>13}{'max error':>12}{'wrong signs':>13}")

    def prepared(self, name, seconds):
        print(f"{name:44}{seconds:10.3f}")

    def queries(self, name, seconds, distance=None, signed=True, count=None):
        line = f"{name:44}{seconds:10.3f}{seconds / (count or self.count) * 1e6:13.3f}"
        if distance is not None:
            error = np.abs(np.abs(distance) - np.abs(self.truth)).max() / self.size
            wrong = np.count_nonzero((distance < 0) != (self.truth < 0)) if signed else None
            line += f"{error:12.2e}" + (f"{wrong / len(self.truth):13.2%}" if signed else f"{'unsigned':>13}")
        print(line)


def run_bilayer(table, mesh, points, checked, given):
    seconds, level_set = best(given.repeats, lambda: bilayer.build(mesh, resolution=given.resolution))
    table.prepared(f"bilayer: build at {given.resolution}", seconds)
    seconds, field = best(given.repeats, lambda: bilayer.Field(level_set, mesh))
    table.prepared("bilayer: Field with mesh", seconds)
    seconds, answer = best(given.repeats, lambda: field.closest(points))
    table.queries("bilayer: closest (exact, signed)", seconds, answer.distance[checked])
    seconds, answer = best(given.repeats, lambda: field.sample(points))
    table.queries("bilayer: sample (in the band)", seconds)
    return level_set


def run_open3d(table, mesh, points, checked, given):
    open3d = package("open3d")
    if open3d is None:
        return
    tensor = open3d.core.Tensor

    def scene():
        made = open3d.t.geometry.RaycastingScene()
        made.add_triangles(tensor(np.ascontiguousarray(mesh.vertices)), tensor(np.ascontiguousarray(mesh.faces)))
        made.compute_distance(tensor(points[:1]))  # builds its hierarchy
        return made

    seconds, made = best(given.repeats, scene)
    table.prepared("Open3D: RaycastingScene", seconds)
    query = tensor(points)
    seconds, answer = best(given.repeats, lambda: made.compute_signed_distance(query))
    table.queries("Open3D: compute_signed_distance", seconds, answer.numpy()[checked])
    seconds, answer = best(given.repeats, lambda: made.compute_closest_points(query))
    gap = np.linalg.norm(answer["points"].numpy() - points, axis=1)
    table.queries("Open3D: compute_closest_points", seconds, gap[checked], signed=False)


def run_scipy(table, mesh, points, checked, given, random):
    spatial = package("scipy.spatial")
    if spatial is None:
        return
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(areas), size=given.samples, p=areas / areas.sum())
    samples = (mesh.vertices[mesh.faces[chosen]] * random.dirichlet((1, 1, 1), size=given.samples)[:, :, None]).sum(1)
    seconds, tree = best(1, lambda: spatial.cKDTree(samples))
    table.prepared(f"scipy: cKDTree of {given.samples:,} samples", seconds)
    some = points[: max(len(points) // TREE_PART, given.checked)]
    seconds, answer = best(1, lambda: tree.query(some, workers=-1)[0])
    table.queries(f"scipy: query of {len(some):,} points", seconds, answer[checked], signed=False, count=len(some))


def first_build(mesh, options):
    """Seconds of the first build in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "mesh.npz")
        np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
        code = (
            "import time, numpy, bilayer\n"
            f"arrays = numpy.load({path!r})\n"
            "mesh = bilayer.Mesh(arrays['vertices'], arrays['faces'])\n"
            "begin = time.perf_counter()\n"
            f"bilayer.build(mesh, **{options!r})\n"
            "print(time.perf_counter() - begin)\n"
        )
        return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


def run_openvdb(level_set, mesh, given):
    """Builds take turns, so that what else the machine does slows all of them."""
    module = package("pyopenvdb")
    if module is None:
        return
    spacing = level_set.voxel_size
    transform = module.createLinearTransform(spacing)
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    make = module.FloatGrid.createLevelSetFromPolygons
    options = {f"bilayer: sign='auto', which is {level_set.sign}": {"voxel_size": spacing}}
    if level_set.sign != "normals":
        options["bilayer: sign='normals'"] = {"voxel_size": spacing, "sign": "normals"}
    times = {name: [] for name in ("OpenVDB", *options)}
    built = {}
    for _ in range(given.repeats):
        seconds, grid = best(1, lambda: make(vertices, triangles=faces, transform=transform, halfWidth=3.0))
        times["OpenVDB"].append(seconds)
        for name, chosen in options.items():
            seconds, built[name] = best(1, lambda chosen=chosen: bilayer.build(mesh, **chosen))
            times[name].append(seconds)
    sparse = level_set.sparse()
    random = np.random.default_rng(1)
    picked = random.choice(len(sparse.values), size=min(given.checked, len(sparse.values)), replace=False)
    voxels = sparse.coordinates[picked]
    truth = brute_force(mesh, spacing * voxels)
    accessor = grid.getConstAccessor()
    values = {"OpenVDB": np.array([accessor.getValue(tuple(map(int, voxel))) for voxel in voxels])}
    for name, field in built.items():
        dense = field.to_numpy()
        corner = np.round(np.asarray(dense.origin) / spacing).astype(int)
        values[name] = dense.values[tuple((voxels - corner).T)]
    print(f"\nbuild of {level_set.active_voxels:,} voxels of {spacing:.4g}, medians of {given.repeats} in turn, and "
          f"the first in a process of its own; errors [voxels] at {len(picked):,} voxels")
    print(f"{'':44}{'seconds':>10}{'OpenVDB takes':>15}{'first':>10}{'max error':>12}{'wrong signs':>13}")
    for name, seconds in times.items():
        error = (np.abs(np.abs(values[name]) - np.abs(truth)) / spacing).max()
        wrong = np.mean((values[name] < 0) != (truth < 0))
        ratio = np.median(np.array(times["OpenVDB"]) / seconds)
        first = f"{first_build(mesh, options[name]):10.3f}" if name in options else f"{'':10}"
        print(f"{name:44}{np.median(seconds):10.3f}{ratio:13.1f} x{first}{error:12.2e}{wrong:13.2%}")


def run(path, given):
    mesh = bilayer.read_mesh(path)
    random = np.random.default_rng(3)
    points = make_points(mesh, given.points, random)
    checked = slice(0, given.checked)
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    print(f"{path}: {len(mesh.faces):,} faces; {len(points):,} points, {given.checked:,} checked; "
          "errors relative to the longest side")
    table = Table(brute_force(mesh, points[checked]), size, len(points))
    level_set = run_bilayer(table, mesh, points, checked, given)
    run_open3d(table, mesh, points, checked, given)
    run_scipy(table, mesh, points, checked, given, random)
    run_openvdb(level_set, mesh, given)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", help="closed meshes")
    parser.add_argument("--points", type=int, default=1_000_000, help="query points (default: %(default)s)")
    parser.add_argument("--checked", type=int, default=1000, help="points that are checked (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=1_000_000, help="of the cKDTree (default: %(default)s)")
    parser.add_argument("--resolution", type=int, default=256, help="of the field (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=5, help="of which the best or median counts (default: %(default)s)")
    given = parser.parse_args()
    for path in given.meshes:
        run(path, given)


if __name__ == "__main__":
    main()
