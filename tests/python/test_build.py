# SPDX-License-Identifier: Apache-2.0
"""build() and rebuild(): options, progress, cancellation, devices."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import bilayer


def test_voxel_size(box):
    assert bilayer.build(box, voxel_size=0.125).voxel_size == 0.125
    assert bilayer.build(box, resolution=16) == bilayer.build(box, voxel_size=0.125)


def test_widths(box):
    narrow = bilayer.build(box, voxel_size=0.125)
    assert narrow.exterior_width == narrow.interior_width == 0.375
    wide = bilayer.build(box, voxel_size=0.125, half_width=0.5)
    assert wide.exterior_width == 0.5 and wide == bilayer.build(box, voxel_size=0.125, half_width_voxels=4)
    uneven = bilayer.build(box, voxel_size=0.125, exterior_width_voxels=2, interior_width_voxels=5)
    assert (uneven.exterior_width, uneven.interior_width) == (0.25, 0.625)


@pytest.mark.parametrize("method", ["exact", "double-layer", "pseudonormal"])
def test_methods(sphere, method):
    level_set = bilayer.build(sphere, resolution=32, method=method)
    assert level_set.method == method
    centres = level_set.sparse()
    truth = np.linalg.norm(centres.origin + centres.spacing * centres.coordinates, axis=1) - 1
    assert np.abs(centres.values - truth).max() < 0.5 * level_set.voxel_size


@pytest.mark.parametrize("sign", ["auto", "normals", "winding", "flood"])
def test_signs(box, sign):
    level_set = bilayer.build(box, resolution=16, sign=sign)
    assert level_set.sign == ("normals" if sign == "auto" else sign)
    assert bilayer.mass_properties(level_set).volume == pytest.approx(8, rel=0.02)


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({}, ValueError, "voxel_size, resolution: expected exactly one"),
        ({"resolution": 8, "voxel_size": 1}, ValueError, "expected exactly one of"),
        ({"voxel_size": 0}, ValueError, "voxel_size is 0, and must be above 0"),
        ({"voxel_size": -1}, ValueError, "voxel_size is -1"),
        ({"voxel_size": float("nan")}, ValueError, "voxel_size is nan"),
        ({"voxel_size": "small"}, ValueError, "voxel_size: expected a number, got a 'str'"),
        ({"voxel_size": 1e300}, ValueError, "voxel_size"),
        ({"voxel_size": 1e-9}, ValueError, "voxel_size 1e-09 is below"),
        ({"resolution": float("inf")}, ValueError, "resolution is inf"),
        ({"resolution": 8, "half_width": 1e9}, ValueError, "half_width is 1e[+]09 .* voxels"),
        ({"resolution": 8, "half_width_voxels": 2000}, ValueError, "half_width_voxels is 2000, .* at most 1000"),
        ({"resolution": 8, "half_width": 1, "half_width_voxels": 3}, ValueError, "only one of half_width"),
        ({"resolution": 8, "half_width": 1, "exterior_width_voxels": 3}, ValueError, "only one of half_width"),
        ({"resolution": 8, "method": "best"}, ValueError, "method: expected one of 'exact'.*got 'best'"),
        ({"resolution": 8, "method": "prism"}, ValueError, 'method: .* OpenCL device: device="opencl"'),
        ({"resolution": 8, "sign": "plus"}, ValueError, "sign: expected one of 'auto'"),
        ({"resolution": 8, "gap_voxels": 101}, ValueError, "gap_voxels must be in"),
        ({"resolution": 8, "delta": 9, "method": "double-layer"}, ValueError, "delta"),
        ({"resolution": 8, "threads": -1}, ValueError, "threads"),
        ({"resolution": 8, "threads": 1.5}, ValueError, "threads: expected an integer, got a 'float'"),
        ({"resolution": 8, "threads": 10**30}, ValueError, "threads is 10+, and must be an integer"),
        ({"resolution": 8, "gap_voxels": 1e300}, ValueError, "gap_voxels is 1e[+]300, .* range of float32"),
        ({"resolution": 8, "unite": "no"}, ValueError, "unite: expected True or False, got a 'str'"),
        ({"resolution": 8, "method": 3}, ValueError, "method: expected a string, got a 'int'"),
        ({"resolution": 8, "device": "gpu"}, ValueError, "device: expected 'cpu', 'opencl'"),
        ({"resolution": 8, "progress": 3}, ValueError, "progress: expected a callable, got a 'int'"),
        ({"resolutoin": 8}, TypeError, r"build\(\) got an unexpected keyword argument 'resolutoin'"),
    ],
)
def test_bad_options(box, options, error, message):
    with pytest.raises(error, match=message):
        bilayer.build(box, **options)


def test_bad_meshes_are_named():
    with pytest.raises(ValueError, match="mesh: the mesh has no triangle"):
        bilayer.build(bilayer.Mesh(np.zeros((0, 3)), []), voxel_size=1)


def test_threads_change_no_byte(sphere):
    assert bilayer.build(sphere, resolution=40, threads=1) == bilayer.build(sphere, resolution=40)


def test_progress_rises_to_one_on_the_calling_thread(sphere):
    seen = []
    bilayer.build(sphere, resolution=300, progress=lambda done: seen.append((done, threading.get_ident())))
    fractions = [done for done, _ in seen]
    assert fractions == sorted(fractions) and fractions[-1] == 1 and len(fractions) > 1
    assert {thread for _, thread in seen} == {threading.get_ident()}


def test_progress_cancels(sphere):
    with pytest.raises(bilayer.Cancelled):
        bilayer.build(sphere, resolution=1000, progress=lambda done: False)


def test_progress_returns_a_bool(sphere):
    assert bilayer.build(sphere, resolution=300, progress=lambda done: np.bool_(True)).active_voxels > 0
    with pytest.raises(bilayer.Cancelled):
        bilayer.build(sphere, resolution=1000, progress=lambda done: np.bool_(False))
    with pytest.raises(ValueError, match="progress: expected it to return True, False or None, got a 'str'"):
        bilayer.build(sphere, resolution=300, progress=lambda done: "on")


def test_errors_of_progress_are_raised(sphere):
    def fail(done):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        bilayer.build(sphere, resolution=1000, progress=fail)


# Each would run for minutes.
LONG_CALLS = {
    "build": ("mesh = bilayer.sphere(1, 6)", "bilayer.build(mesh, resolution=6000)"),
    "rebuild": (
        "mesh = bilayer.sphere(1, 6); level_set = bilayer.build(mesh, resolution=100)\n"
        "moved = bilayer.Mesh(mesh.vertices * [1, 1, 1.1], mesh.faces)",
        "while True: bilayer.rebuild(level_set, mesh, moved, resolution=100)",
    ),
    "inspect": ("mesh = bilayer.sphere(1, 8)", "while True: bilayer.inspect(mesh)"),
    "seed": (
        "mesh = bilayer.sphere(1, 5); tank = bilayer.build(bilayer.box((0.1, 0.1, 0.1)), voxel_size=0.0005)",
        "bilayer.seed(tank, mesh)",
    ),
    "particles": ("tank = bilayer.build(bilayer.box(), resolution=64)", "bilayer.particles(tank, per_voxel=1000)"),
    "obstacle": ("mesh = bilayer.sphere(1, 5)", "bilayer.obstacle(mesh, 0.0005)"),
    "closest": (
        "mesh = bilayer.sphere(1, 6); field = bilayer.Field(bilayer.build(mesh, resolution=50), mesh)\n"
        "points = np.random.default_rng(0).normal(size=(4_000_000, 3)).astype(np.float32)",
        "field.closest(points)",
    ),
    "distances": (
        "mesh = bilayer.sphere(1, 6); body = bilayer.Collider(mesh, bilayer.build(mesh, resolution=50))\n"
        "poses = [None, bilayer.Pose((1.9, 0.1, 0.2))]",
        "bilayer.distances(body, poses, np.tile([[0, 1]], (1_000_000, 1)))",
    ),
}


@pytest.mark.parametrize("name", LONG_CALLS)
def test_control_c_cancels(name):
    prepare, call = LONG_CALLS[name]
    code = (
        "import bilayer, numpy as np\n"
        f"{prepare}\n"
        "print('ready', flush=True)\n"
        "try:\n"
        f"    {call}\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=os.environ) as child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        sent = time.monotonic()
        try:
            assert child.stdout.readline() == "interrupted\n"
        finally:
            child.kill()
        assert time.monotonic() - sent < 5


def test_rebuild(sphere):
    old = bilayer.build(sphere, voxel_size=0.05)
    vertices = sphere.vertices.copy()
    moved = vertices[:, 2] > 0.9
    vertices[moved] *= 1.05
    new = bilayer.Mesh(vertices, sphere.faces)
    faces = np.flatnonzero(moved[sphere.faces].any(axis=1))
    whole = bilayer.build(new, voxel_size=0.05)
    updated = bilayer.rebuild(old, sphere, new, faces, voxel_size=0.05)
    assert updated == whole and updated == bilayer.rebuild(old, sphere, new, voxel_size=0.05)
    with pytest.raises(ValueError, match="moved"):
        bilayer.rebuild(old, sphere, new, faces[1:], voxel_size=0.05)
    with pytest.raises(ValueError, match=r"moved\[0\] is 99999"):
        bilayer.rebuild(old, sphere, new, [99999], voxel_size=0.05)
    with pytest.raises(ValueError, match="level_set: the level set has voxels of 0.05"):
        bilayer.rebuild(old, sphere, new, faces, voxel_size=0.06)
    with pytest.raises(ValueError, match="another mesh"):
        bilayer.rebuild(old, new, sphere, faces, voxel_size=0.05)


def test_opencl(sphere):
    found = bilayer.devices()
    with pytest.raises(bilayer.DeviceError):
        bilayer.build(sphere, resolution=16, device="opencl:no such device")
    if not found:
        pytest.skip("no OpenCL device")
    here, there = (bilayer.build(sphere, resolution=32, device=device) for device in ("cpu", "opencl"))
    assert np.array_equal(here.sparse().coordinates, there.sparse().coordinates)
    assert np.abs(here.sparse().values - there.sparse().values).max() <= 1e-5 * here.voxel_size


def bent(mesh, by):
    vertices = mesh.vertices.copy()
    vertices[vertices[:, 2] > 0.6, 0] += by
    return bilayer.Mesh(vertices, mesh.faces)


def test_rebuild_frame_by_frame(sphere):
    frames = [bent(sphere, 0.02 * number) for number in range(5)]
    level_set = bilayer.build(frames[0], resolution=32)
    for old, new in zip(frames, frames[1:]):
        level_set = bilayer.rebuild(level_set, old, new)
        assert level_set == bilayer.build(new, voxel_size=level_set.voxel_size)
    with pytest.raises(ValueError, match="voxel_size, resolution: expected at most one"):
        bilayer.rebuild(level_set, frames[-1], sphere, resolution=32, voxel_size=0.1)


def test_rebuild_names_the_wrong_mesh(sphere, box):
    level_set = bilayer.build(sphere, voxel_size=0.1)
    flat = bilayer.Mesh(0 * sphere.vertices, sphere.faces)
    wrong = (np.full_like(sphere.vertices, np.nan), sphere.faces)
    for old, new, message in [
        (sphere, box, "new_mesh: the mesh had"),
        (sphere, flat, "new_mesh: the mesh has no triangle with an area"),
        (sphere, wrong, r"new_mesh: vertices\[0, 0\] is nan"),
        (wrong, sphere, r"old_mesh: vertices\[0, 0\] is nan"),
        (box, sphere, "level_set: the level set is of another mesh"),
    ]:
        with pytest.raises(ValueError, match=message):
            bilayer.rebuild(level_set, old, new)
    with pytest.raises(ValueError, match="moved lacks triangle"):
        bilayer.rebuild(level_set, sphere, bent(sphere, 0.1), [])


def test_the_last_report_also_cancels(box):
    with pytest.raises(bilayer.Cancelled):
        bilayer.build(box, resolution=8, progress=lambda done: done < 1)
