# SPDX-License-Identifier: Apache-2.0
"""Python packages on the same mesh and points: bilayer, Open3D, OpenVDB's module, scipy's cKDTree.

Times are medians of several rounds, in which the packages take turns, so that what else the machine does slows all of
them. Errors and wrong signs are against brute force over all triangles in double precision. Packages that are not
installed are left out.
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

TREE_PART = 20  # the tree is asked about one in so many points: far ones take it long


def package(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name} is not installed: left out")
        return None


def timed(call):
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result


def in_turn(rounds, calls):
    """The times of each of several named calls, which take turns, and the last results."""
    times, results = {name: [] for name in calls}, {}
    for _ in range(rounds):
        for name, call in calls.items():
            seconds, results[name] = timed(call)
            times[name].append(seconds)
    return {name: np.array(seconds) for name, seconds in times.items()}, results


def squared_distance(point, a, b, c):
    """Squared distances of a point to triangles (T, 3): to the plane inside the prism, else to the edges."""
    def to_edge(start, end):
        along, offset = end - start, point - start
        t = np.clip((offset * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-300), 0, 1)
        gap = offset - t[..., None] * along
        return (gap * gap).sum(-1)

    normal = np.cross(b - a, c - a)
    area2 = (normal * normal).sum(-1)
    edges = np.minimum(np.minimum(to_edge(a, b), to_edge(b, c)), to_edge(c, a))
    above = np.ones(edges.shape, bool)
    for start, end in ((a, b), (b, c), (c, a)):
        above &= (np.cross(normal, end - start) * (point - start)).sum(-1) >= 0
    plane = ((point - a) * normal).sum(-1) ** 2 / np.maximum(area2, 1e-300)
    return np.where(above & (area2 > 0), np.minimum(plane, edges), edges)


def winding(point, a, b, c):
    """The winding number of a point, by solid angles."""
    a, b, c = a - point, b - point, c - point
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    det = (a * np.cross(b, c)).sum(-1)
    div = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(det, div).sum() / (2 * np.pi)


def brute_force(mesh, points):
    a, b, c = mesh.vertices.astype(float)[mesh.faces].transpose(1, 0, 2)
    result = []
    for point in points.astype(float):
        distance = np.sqrt(squared_distance(point, a, b, c).min())
        result.append(-distance if winding(point, a, b, c) > 0.5 else distance)
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


class Queries:
    """Calls that answer points, as (call, the distances in its result or None, whether they are signed, points)."""

    def __init__(self, points):
        self.points, self.calls = points, {}
        print(f"{'preparation':44}{'seconds':>10}")

    def prepared(self, name, seconds):
        print(f"{name:44}{seconds:10.3f}")

    def add(self, name, call, distances=None, signed=True, count=None):
        self.calls[name] = (call, distances, signed, count or len(self.points))

    def run(self, rounds, truth, size):
        """Errors are of the first points, whose true distances are given, relative to the size."""
        times, results = in_turn(rounds, {name: call for name, (call, *_) in self.calls.items()})
        own = next(iter(times))
        print(f"\n{'queries':44}{'seconds':>10}{'per million':>13}{'ratio':>8}{'max error':>12}{'wrong signs':>13}")
        for name, (_, distances, signed, count) in self.calls.items():
            ratio = np.median(times[name] / times[own]) * len(self.points) / count
            seconds = np.median(times[name])
            line = f"{name:44}{seconds:10.3f}{seconds / count * 1e6:13.3f}{ratio:8.2f}"
            if distances is not None:
                found = distances(results[name])[: len(truth)]
                line += f"{np.abs(np.abs(found) - np.abs(truth)).max() / size:12.2e}"
                line += f"{np.mean((found < 0) != (truth < 0)):13.2%}" if signed else f"{'unsigned':>13}"
            print(line)


def add_bilayer(queries, mesh, given):
    seconds, level_set = timed(lambda: bilayer.build(mesh, resolution=given.resolution))
    queries.prepared(f"bilayer: build at {given.resolution}", seconds)
    seconds, field = timed(lambda: bilayer.Field(level_set, mesh))
    queries.prepared("bilayer: Field with mesh", seconds)
    points = queries.points
    queries.add("bilayer: closest (exact, signed)", lambda: field.closest(points), lambda answer: answer.distance)
    queries.add("bilayer: sample (in the band)", lambda: field.sample(points))
    return level_set


def rays_hit(scene_of, tensor):
    """Whether a ray hits a triangle that it passes through."""
    corners, face = np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), np.uint32([[0, 1, 2]])
    return scene_of(corners, face).count_intersections(tensor(np.float32([[0, 0, -1, 0, 0, 1]]))).numpy()[0] == 1


def add_open3d(queries, mesh):
    open3d = package("open3d")
    if open3d is None:
        return
    tensor = open3d.core.Tensor

    def scene_of(vertices, faces):
        made = open3d.t.geometry.RaycastingScene()
        made.add_triangles(tensor(np.ascontiguousarray(vertices)), tensor(np.ascontiguousarray(faces)))
        made.compute_distance(tensor(np.ascontiguousarray(vertices[:1])))  # builds its hierarchy
        return made

    if not rays_hit(scene_of, tensor):
        print("Open3D's rays hit nothing here, so that it takes all points for outside; see bench/open3d_rays.cpp")
    seconds, scene = timed(lambda: scene_of(mesh.vertices, mesh.faces))
    queries.prepared("Open3D: RaycastingScene", seconds)
    points, query = queries.points, tensor(queries.points)
    queries.add("Open3D: compute_signed_distance", lambda: scene.compute_signed_distance(query), lambda d: d.numpy())
    queries.add("Open3D: compute_closest_points", lambda: scene.compute_closest_points(query),
                lambda answer: np.linalg.norm(answer["points"].numpy() - points, axis=1), signed=False)


def add_scipy(queries, mesh, given, random):
    spatial = package("scipy.spatial")
    if spatial is None:
        return
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(areas), size=given.samples, p=areas / areas.sum())
    samples = (mesh.vertices[mesh.faces[chosen]] * random.dirichlet((1, 1, 1), size=given.samples)[:, :, None]).sum(1)
    seconds, tree = timed(lambda: spatial.cKDTree(samples))
    queries.prepared(f"scipy: cKDTree of {given.samples:,} samples", seconds)
    some = queries.points[: max(len(queries.points) // TREE_PART, given.checked)]
    queries.add(f"scipy: query of {len(some):,} points", lambda: tree.query(some, workers=-1)[0],
                lambda distance: distance, signed=False, count=len(some))


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


def values_at(level_set, voxels):
    values, origin, spacing = level_set.to_numpy()
    return values[tuple((voxels - np.round(origin / spacing).astype(int)).T)]


def run_openvdb(level_set, mesh, given):
    module = package("pyopenvdb")
    if module is None:
        return
    spacing = level_set.voxel_size
    transform = module.createLinearTransform(spacing)
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    make = module.FloatGrid.createLevelSetFromPolygons
    options = {f"bilayer: sign='auto', which is {level_set.sign}": {"voxel_size": spacing}}
    if level_set.sign != "normals":
        for sign in ("normals", "flood"):
            options[f"bilayer: sign='{sign}'"] = {"voxel_size": spacing, "sign": sign}
    calls = {"OpenVDB": lambda: make(vertices, triangles=faces, transform=transform, halfWidth=3.0)}
    calls |= {name: lambda chosen=chosen: bilayer.build(mesh, **chosen) for name, chosen in options.items()}
    times, built = in_turn(given.repeats, calls)
    sparse = level_set.sparse()
    random = np.random.default_rng(1)
    picked = random.choice(len(sparse.values), size=min(given.checked, len(sparse.values)), replace=False)
    voxels = sparse.coordinates[picked]
    truth = brute_force(mesh, spacing * voxels)
    accessor = built.pop("OpenVDB").getConstAccessor()
    values = {name: values_at(field, voxels) for name, field in built.items()}
    values["OpenVDB"] = np.array([accessor.getValue(tuple(map(int, voxel))) for voxel in voxels])
    print(f"\nbuild of {level_set.active_voxels:,} voxels of {spacing:.4g}, medians of {given.repeats} in turn, and "
          f"the first in a process of its own; errors [voxels] at {len(picked):,} voxels")
    print(f"{'':44}{'seconds':>10}{'OpenVDB takes':>15}{'first':>10}{'max error':>12}{'wrong signs':>13}")
    for name, seconds in times.items():
        error = (np.abs(np.abs(values[name]) - np.abs(truth)) / spacing).max()
        wrong = np.mean((values[name] < 0) != (truth < 0))
        ratio = np.median(times["OpenVDB"] / seconds)
        first = f"{first_build(mesh, options[name]):10.3f}" if name in options else f"{'':10}"
        print(f"{name:44}{np.median(seconds):10.3f}{ratio:13.1f} x{first}{error:12.2e}{wrong:13.2%}")


def run(path, given):
    mesh = bilayer.read_mesh(path)
    random = np.random.default_rng(3)
    points = make_points(mesh, given.points, random)
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    print(f"{path}: {len(mesh.faces):,} faces; {len(points):,} points, {given.checked:,} checked; medians of "
          f"{given.repeats} rounds; ratios to bilayer's closest; errors relative to the longest side")
    queries = Queries(points)
    level_set = add_bilayer(queries, mesh, given)
    add_open3d(queries, mesh)
    add_scipy(queries, mesh, given, random)
    queries.run(given.repeats, brute_force(mesh, points[: given.checked]), size)
    run_openvdb(level_set, mesh, given)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", help="mesh files; signs of open ones are checked by winding numbers")
    parser.add_argument("--points", type=int, default=1_000_000, help="query points (default: %(default)s)")
    parser.add_argument("--checked", type=int, default=1000, help="points that are checked (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=1_000_000, help="of the cKDTree (default: %(default)s)")
    parser.add_argument("--resolution", type=int, default=256, help="of the field (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=5, help="rounds, of which medians count (default: %(default)s)")
    given = parser.parse_args()
    for path in given.meshes:
        run(path, given)


if __name__ == "__main__":
    main()
