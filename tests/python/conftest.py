# SPDX-License-Identifier: Apache-2.0
"""What the tests share: a sphere and a box with their fields."""

import numpy as np
import pytest

import bilayer


@pytest.fixture(scope="session")
def sphere():
    return bilayer.sphere(1.0, subdivisions=4)


@pytest.fixture(scope="session")
def sphere_set(sphere):
    return bilayer.build(sphere, resolution=48)


@pytest.fixture(scope="session")
def sphere_field(sphere, sphere_set):
    return bilayer.Field(sphere_set, sphere)


@pytest.fixture(scope="session")
def box():
    return bilayer.box((2, 2, 2))


@pytest.fixture(scope="session")
def box_set(box):
    return bilayer.build(box, resolution=32)


@pytest.fixture(scope="session")
def box_field(box, box_set):
    return bilayer.Field(box_set, box)


@pytest.fixture(scope="session")
def collider(box, box_set):
    return bilayer.Collider(box, box_set)


@pytest.fixture
def random():
    return np.random.default_rng(38)


def box_distance(points, half=1.0):
    """The signed distance of points to a cube."""
    q = np.abs(points) - half
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)
