# SPDX-License-Identifier: Apache-2.0
"""Python packages on the same mesh and points: bilayer, Open3D, OpenVDB's module, scipy's cKDTree.

Times are the best of several runs. Errors and wrong signs are against brute force over all triangles in double
precision. Packages that are not installed are left out.
"""

import argparse
import importlib
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


def run_openvdb(level_set, mesh, given):
    module = package("pyopenvdb")
    if module is None:
        return
    spacing = level_set.voxel_size
    transform = module.createLinearTransform(spacing)
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    make = module.FloatGrid.createLevelSetFromPolygons
    seconds, grid = best(given.repeats, lambda: make(vertices, triangles=faces, transform=transform, halfWidth=3.0))
    ours, _ = best(given.repeats, lambda: bilayer.build(mesh, voxel_size=spacing))
    sparse = level_set.sparse()
    random = np.random.default_rng(1)
    chosen = random.choice(len(sparse.values), size=min(given.checked, len(sparse.values)), replace=False)
    voxels = sparse.coordinates[chosen]
    truth = brute_force(mesh, spacing * voxels)
    accessor = grid.getConstAccessor()
    theirs = np.array([accessor.getValue(tuple(map(int, voxel))) for voxel in voxels])
    print(f"\nbuild of {level_set.active_voxels:,} voxels of {spacing:.4g}, errors [voxels] at {len(chosen):,} of them")
    for name, time_taken, values in (("bilayer", ours, sparse.values[chosen]), ("OpenVDB", seconds, theirs)):
        error, wrong = np.abs(np.abs(values) - np.abs(truth)), (values < 0) != (truth < 0)
        print(
            f"{name + ': build':44}{time_taken:10.3f}   max error {error.max() / spacing:.2e}, "
            f"wrong signs {wrong.mean():.2%}"
        )
    print(f"OpenVDB takes {seconds / ours:.1f} times as long")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", help="a closed mesh")
    parser.add_argument("--points", type=int, default=1_000_000, help="query points (default: %(default)s)")
    parser.add_argument("--checked", type=int, default=1000, help="points that are checked (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=1_000_000, help="of the cKDTree (default: %(default)s)")
    parser.add_argument("--resolution", type=int, default=256, help="of the field (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=5, help="runs of which the best counts (default: %(default)s)")
    given = parser.parse_args()
    mesh = bilayer.read_mesh(given.mesh)
    random = np.random.default_rng(3)
    points = make_points(mesh, given.points, random)
    checked = slice(0, given.checked)
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    print(f"{given.mesh}: {len(mesh.faces):,} faces; {len(points):,} points, {given.checked:,} checked; "
          "errors relative to the longest side")
    table = Table(brute_force(mesh, points[checked]), size, len(points))
    level_set = run_bilayer(table, mesh, points, checked, given)
    run_open3d(table, mesh, points, checked, given)
    run_scipy(table, mesh, points, checked, given, random)
    run_openvdb(level_set, mesh, given)


if __name__ == "__main__":
    main()
