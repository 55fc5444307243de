# SPDX-License-Identifier: Apache-2.0
"""Threads, memory, and objects that outlive each other."""

import gc
import multiprocessing
import pickle
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import bilayer


def resident_bytes():
    with open("/proc/self/statm") as stream:
        return 4096 * int(stream.read().split()[1])


def test_queries_from_32_threads(box_field, random):
    points = random.uniform(-2, 2, size=(32, 5000, 3)).astype(np.float32)
    expected = [box_field.closest(some).distance for some in points]
    with ThreadPoolExecutor(32) as pool:
        answers = list(pool.map(lambda some: box_field.closest(some).distance, points))
    assert all(np.array_equal(one, other) for one, other in zip(answers, expected))


def test_builds_and_contacts_from_32_threads(sphere, collider):
    expected = bilayer.build(sphere, resolution=24)
    contacts = bilayer.collide(collider, bilayer.Pose((0, 0, 1.99)), collider, None, margin=0.05)

    def work(number):
        built = bilayer.build(sphere, resolution=24)
        found = bilayer.collide(collider, bilayer.Pose((0, 0, 1.99)), collider, None, margin=0.05)
        return built == expected and np.array_equal(found.position, contacts.position)

    with ThreadPoolExecutor(32) as pool:
        assert all(pool.map(work, range(64)))


def test_one_cache_from_many_threads(collider):
    cache = bilayer.ContactCache()

    def work(number):
        pose = bilayer.Pose((0.001 * number, 0, 1.99))
        cached = bilayer.collide(collider, pose, collider, None, margin=0.05, cache=cache)
        return np.array_equal(cached.position, bilayer.collide(collider, pose, collider, None, margin=0.05).position)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(work, range(64)))


@pytest.mark.parametrize(
    "name",
    ["build", "inspect", "closest", "Mesh", "Field", "Collider", "from_numpy", "particles"]
    + ["hull", "spheres", "triangles"],
)
def test_other_threads_run_during_calls(name, sphere, sphere_field):
    mesh = bilayer.sphere(1, subdivisions=7)
    level_set = bilayer.build(mesh, resolution=200)
    dense = level_set.to_numpy()
    points = np.random.default_rng(1).uniform(-3, 3, size=(2_000_000, 3)).astype(np.float32)
    calls = {
        "build": lambda: bilayer.build(mesh, resolution=300),
        "inspect": lambda: bilayer.inspect(mesh),
        "closest": lambda: sphere_field.closest(points),
        "Mesh": lambda: [bilayer.Mesh(mesh.vertices, mesh.faces) for _ in range(30)],
        "Field": lambda: bilayer.Field(level_set, mesh),
        "Collider": lambda: bilayer.Collider(mesh, level_set),
        "from_numpy": lambda: bilayer.LevelSet.from_numpy(*dense),
        "hull": lambda: bilayer.Shape.hull(points[:200_000]),
        "spheres": lambda: bilayer.Shape.spheres(points[:400], 1),
        "triangles": lambda: [bilayer.Shape.triangles(mesh) for _ in range(1000)],
        "particles": lambda: bilayer.particles(level_set, per_voxel=3),
    }
    worker = threading.Thread(target=calls[name])
    begin = time.monotonic()
    ticks = []
    worker.start()
    while worker.is_alive():
        ticks.append(time.monotonic())
        time.sleep(0.001)
    worker.join()
    # with the GIL held, this thread would stand still for nearly all of the call
    longest = np.diff([begin] + ticks + [time.monotonic()]).max()
    assert longest < 0.5 * (time.monotonic() - begin)


def test_results_outlive_what_they_come_from(box):
    level_set = bilayer.build(box, resolution=32)
    field = bilayer.Field(level_set, box)
    points = np.random.default_rng(2).uniform(-2, 2, size=(1000, 3)).astype(np.float32)
    expected = field.closest(points).distance.copy()
    coordinates = level_set.sparse().coordinates
    kept = coordinates.copy()
    answer = field.closest(points)
    distance, normal = answer.distance, answer.normal
    collider = bilayer.Collider(box, level_set)
    inner = collider.exact_field
    del answer, field, level_set, collider, points
    gc.collect()
    others = [np.zeros(10000) for _ in range(100)]
    assert np.array_equal(distance, expected) and normal.shape == (1000, 3) and np.array_equal(coordinates, kept)
    assert inner.closest([2, 0, 0]).distance == 1
    del others


def test_answers_share_one_buffer(box_field):
    answer = box_field.sample(np.zeros((10, 3)))
    assert answer.distance.base is answer.gradient.base
    answer.distance[:] = 7  # the caller's own
    assert (answer.distance == 7).all()


def test_inputs_are_left_alone(box_field):
    points = np.array([[2, 0, 0]], dtype=np.float32)
    box_field.sample(points).distance[:] = 0
    assert points.tolist() == [[2, 0, 0]]


def test_memory_does_not_grow(box):
    points = np.random.default_rng(3).uniform(-2, 2, size=(1000, 3))

    def work():
        level_set = bilayer.build(box, resolution=12)
        field = bilayer.Field(level_set, box)
        field.sample(points), field.closest(points), field.raycast(points, [0, 0, 1])
        level_set.to_numpy(), level_set.sparse(), level_set.surface()
        body = bilayer.Collider(box, level_set)
        bilayer.collide(body, bilayer.Pose((0, 0, 1.99)), body, None, margin=0.1, cache=bilayer.ContactCache())
        bilayer.distance(body, bilayer.Pose((3, 0, 0)), body, None)
        pickle.loads(pickle.dumps((level_set, field, body)))
        bilayer.LevelSet.from_numpy(*level_set.to_numpy())
        bilayer.time_of_impact(body, bilayer.Pose((3, 0, 0)), [[-2, 0, 0], [0, 0, 0]], body, None, None)
        with pytest.raises(ValueError):
            field.sample([1])

    for _ in range(200):  # until allocators hold what they keep
        work()
    gc.collect()
    before = resident_bytes()
    for _ in range(1000):
        work()
    gc.collect()
    assert resident_bytes() - before < 8 << 20


@pytest.mark.parametrize(
    "call", ["bilayer.build(mesh, resolution=200)", "field.closest(points)", "level_set.surface()"]
)
def test_daemon_threads_end_with_the_process(call):
    script = f"""
import threading, time
import numpy as np
import bilayer
mesh = bilayer.sphere(1, 5)
level_set = bilayer.build(mesh, resolution=64)
field = bilayer.Field(level_set, mesh)
points = np.random.default_rng(0).uniform(-2, 2, (300000, 3)).astype(np.float32)
def work():
    while True:
        {call}
for _ in range(3):
    threading.Thread(target=work, daemon=True).start()
time.sleep(0.3)
"""
    for _ in range(3):
        result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
        assert (result.returncode, result.stderr) == (0, "")


def test_forked_processes_answer(sphere, sphere_field, random):
    points = random.uniform(-2, 2, size=(5000, 3))
    expected = sphere_field.closest(points).distance
    with multiprocessing.get_context("fork").Pool(2) as pool:
        answers = pool.map_async(sphere_field.closest, [points] * 8).get(timeout=120)
    assert all(np.array_equal(answer.distance, expected) for answer in answers)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_all_values_pickle(protocol, box, box_set, box_field, collider):
    pose = bilayer.Pose((0, 0, 1.99), (0.6, 0, 0, 0.8))
    obstacle = bilayer.obstacle(box, 0.5)
    values = [box, box_set, box_field, collider, pose, obstacle, bilayer.Shape.hull(box.vertices)]
    values += [bilayer.inspect(box), box_set.to_numpy(), bilayer.collide(collider, pose, collider, None)]
    again = pickle.loads(pickle.dumps(values, protocol))
    assert [type(value) for value in again] == [type(value) for value in values]
    assert again[0] == box and again[1] == box_set and again[4] == pose
    assert np.array_equal(again[5].velocity, obstacle.velocity)
    with pytest.raises(TypeError, match="a ContactCache cannot be copied or pickled"):
        pickle.dumps(bilayer.ContactCache(), protocol)
