# SPDX-License-Identifier: Apache-2.0
"""Meshes of other packages, and simple shapes."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, Sequence

import numpy as np

from bilayer._bilayer import Mesh

_ACCEPTED = (
    "a bilayer.Mesh, an object with .vertices and .faces (trimesh) or .triangles (Open3D), an Open3D tensor mesh, "
    "a meshio mesh, or a pair (vertices, faces)"
)


def as_mesh(source: Any) -> Mesh:
    """as_mesh(source) -> Mesh

    Takes the vertices and faces of a mesh of another package, which is not imported:

    - anything with .vertices and .faces, as trimesh;
    - Open3D: .vertices and .triangles of a legacy mesh, .vertex.positions and .triangle.indices of a tensor mesh;
    - meshio: .points and .cells, of which triangles and quads are taken;
    - a pair (vertices, faces).

    Raises ValueError for anything else, and as Mesh does.

    >>> import bilayer
    >>> bilayer.as_mesh(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    Mesh(3 vertices, 1 faces)
    """
    if isinstance(source, Mesh):
        return source
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return Mesh(source.vertices, source.faces)
    if hasattr(source, "vertices") and hasattr(source, "triangles"):
        return Mesh(np.asarray(source.vertices), np.asarray(source.triangles))
    if hasattr(source, "vertex") and hasattr(source, "triangle"):
        return Mesh(_host(source.vertex["positions"]), _host(source.triangle["indices"]))
    if hasattr(source, "points") and hasattr(source, "cells"):
        return Mesh(source.points, _meshio_faces(source.cells))
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return Mesh(source[0], source[1])
    raise ValueError(f"mesh: expected {_ACCEPTED}, got a '{type(source).__name__}'")


def _host(tensor: Any) -> Any:
    """The numpy array of an Open3D tensor on any device."""
    if hasattr(tensor, "cpu"):
        tensor = tensor.cpu()
    return tensor.numpy() if hasattr(tensor, "numpy") else tensor


def _meshio_faces(cells: Any) -> Any:
    """The triangles of meshio's blocks of cells; each quad gives two."""
    blocks = cells.items() if isinstance(cells, dict) else [(block.type, block.data) for block in cells]
    faces = []
    for kind, data in blocks:
        corners = np.asarray(data)
        if kind == "triangle":
            faces.append(corners)
        elif kind == "quad":
            faces.append(corners[:, [0, 1, 2]])
            faces.append(corners[:, [0, 2, 3]])
    if not faces:
        kinds = ", ".join(f"'{kind}'" for kind, _ in blocks)
        raise ValueError(f"mesh: expected cells of type 'triangle' or 'quad', got {kinds or 'none'}")
    return np.concatenate(faces)


def box(size: Sequence[float] = (1, 1, 1)) -> Mesh:
    """box(size=(1, 1, 1)) -> Mesh

    A box of 12 faces, centred at zero. size: three lengths above 0.

    Raises ValueError for another size.

    >>> import bilayer
    >>> bilayer.box((2, 4, 6)).bounds.tolist()
    [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]]
    """
    try:
        lengths = np.asarray(size, dtype=float)
    except (TypeError, ValueError):
        lengths = np.empty(0)
    if lengths.shape != (3,) or not np.all(lengths > 0) or not np.all(np.isfinite(lengths)):
        raise ValueError(f"size: expected three lengths above 0, got {size!r}")
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[side[0], side[a], side[a + 1]] for side in sides for a in (1, 2)]
    return Mesh(corners * lengths, faces)


def sphere(radius: float = 1, subdivisions: int = 3) -> Mesh:
    """sphere(radius=1, subdivisions=3) -> Mesh

    A sphere of 8 * 4^subdivisions faces, from an octahedron, centred at zero.

    Raises ValueError for a radius that is not above 0, and for subdivisions outside 0 to 9.

    >>> import bilayer
    >>> bilayer.sphere(2, subdivisions=1)
    Mesh(18 vertices, 32 faces)
    """
    if not (isinstance(radius, Real) and radius > 0 and np.isfinite(radius)):
        raise ValueError(f"radius is {radius!r}, and must be a number above 0 and finite")
    if not (isinstance(subdivisions, Integral) and 0 <= subdivisions <= 9):
        raise ValueError(f"subdivisions is {subdivisions!r}, and must be an integer of 0 to 9")
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(subdivisions):
        vertices, faces = _subdivided(vertices, faces)
    return Mesh(radius * vertices, faces)


def _subdivided(vertices: Any, faces: Any) -> Any:
    """Cuts each face into four, with the new vertices on the unit sphere."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    middles = vertices[unique].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = len(vertices) + inverse.reshape(-1, 3).T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([vertices, middles]), np.concatenate([np.stack(part, axis=1) for part in parts])
