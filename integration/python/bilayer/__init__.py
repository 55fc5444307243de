# SPDX-License-Identifier: Apache-2.0
"""Exact narrow-band signed distance fields of triangle meshes, and queries and contacts on them.

>>> import bilayer
>>> mesh = bilayer.sphere(1.0)
>>> field = bilayer.Field(bilayer.build(mesh, resolution=64), mesh)
>>> float(field.closest([2, 0, 0]).distance)
1.0
"""

from bilayer._bilayer import (
    Cancelled,
    Collider,
    ContactCache,
    DeviceError,
    Field,
    LevelSet,
    Mesh,
    Obstacle,
    Pose,
    Shape,
    __version__,
    build,
    collide,
    devices,
    distance,
    distances,
    inspect,
    mass_properties,
    obstacle,
    particles,
    read_mesh,
    rebuild,
    seed,
    time_of_impact,
    with_body,
)
from bilayer.meshes import as_mesh, box, sphere
from bilayer.results import (
    BodyDistance,
    ClosestPoints,
    Contacts,
    Dense,
    Hits,
    Impact,
    MassProperties,
    MeshReport,
    Samples,
    Seeded,
    Sparse,
)

__all__ = [
    "BodyDistance",
    "Cancelled",
    "ClosestPoints",
    "Collider",
    "ContactCache",
    "Contacts",
    "Dense",
    "DeviceError",
    "Field",
    "Hits",
    "Impact",
    "LevelSet",
    "MassProperties",
    "Mesh",
    "MeshReport",
    "Obstacle",
    "Pose",
    "Samples",
    "Seeded",
    "Shape",
    "Sparse",
    "__version__",
    "as_mesh",
    "box",
    "build",
    "collide",
    "devices",
    "distance",
    "distances",
    "inspect",
    "mass_properties",
    "obstacle",
    "particles",
    "read_mesh",
    "rebuild",
    "seed",
    "sphere",
    "time_of_impact",
    "with_body",
]
