# SPDX-License-Identifier: Apache-2.0
"""Meshes of other packages, and simple shapes."""

from __future__ import annotations

from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, List, Optional, Sequence, Tuple

import numpy as np

from bilayer._bilayer import Mesh

if TYPE_CHECKING:
    from bilayer._types import MeshLike

_ACCEPTED = (
    "a bilayer.Mesh, an object with .vertices and .faces (trimesh) or .triangles (Open3D), an Open3D tensor mesh, "
    "a meshio mesh, a PyVista PolyData, or a pair (vertices, faces)"
)


def as_mesh(source: MeshLike) -> Mesh:
    """as_mesh(source) -> Mesh

    Takes the vertices and faces of a mesh of another package, which is not imported:

    - anything with .vertices and .faces, as trimesh;
    - Open3D: .vertices and .triangles of a legacy mesh, .vertex.positions and .triangle.indices of a tensor mesh;
    - meshio: .points and .cells, of which triangles and quads are taken;
    - PyVista: .points and .faces of a PolyData of triangles and quads;
    - a pair (vertices, faces).

    Raises ValueError for anything else, and as Mesh does.

    >>> import bilayer
    >>> bilayer.as_mesh(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    Mesh(3 vertices, 1 faces)
    """
    return mesh_of(source, "source")


def mesh_of(source: Any, name: str) -> Mesh:
    """As as_mesh(), for an argument of this name."""
    if isinstance(source, Mesh):
        return source
    try:
        arrays = _arrays(source)
    except (AttributeError, IndexError, KeyError, TypeError) as error:
        raise ValueError(f"{name}: expected {_ACCEPTED}, got a '{_type(source)}' whose data are others") from error
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if arrays is None:
        raise ValueError(f"{name}: expected {_ACCEPTED}, got a '{_type(source)}'")
    try:
        return Mesh(*arrays)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _arrays(source: Any) -> Optional[Tuple[Any, Any]]:
    """The vertices and faces of any mesh; None of something else."""
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return source.vertices, source.faces
    if hasattr(source, "vertices") and hasattr(source, "triangles"):
        return np.asarray(source.vertices), np.asarray(source.triangles)
    if hasattr(source, "vertex") and hasattr(source, "triangle"):
        return _host(source.vertex["positions"]), _host(source.triangle["indices"])
    if hasattr(source, "points") and hasattr(source, "faces"):
        return np.asarray(source.points), _polydata_faces(source.faces)
    if hasattr(source, "points") and hasattr(source, "cells"):
        return source.points, _meshio_faces(source.cells)
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return source[0], source[1]
    return None


def _type(source: Any) -> str:
    return type(source).__name__


def _host(tensor: Any) -> Any:
    """The numpy array of an Open3D tensor on any device."""
    if hasattr(tensor, "cpu"):
        tensor = tensor.cpu()
    return tensor.numpy() if hasattr(tensor, "numpy") else tensor


def _polydata_faces(faces: Any) -> Any:
    """The triangles of PyVista's flat list: the number of corners, then the corners, face by face."""
    flat = np.asarray(faces)
    if flat.ndim != 1 or (flat.size and flat.dtype.kind not in "iu"):
        raise ValueError("expected .faces as flat integers [3, a, b, c, ...] next to .points")
    triangles: List[Any] = []
    quads: List[Any] = []
    at = 0
    if flat.size % 4 == 0 and np.all(flat[::4] == 3):  # without a loop, which is slow
        return flat.reshape(-1, 4)[:, 1:]
    while at < flat.size:
        count = int(flat[at])
        corners = flat[at + 1 : at + 1 + count]
        if count in (3, 4) and corners.size < count:
            raise ValueError(f"expected {count} corners after .faces[{at}], got {corners.size}: .faces is cut short")
        if count not in (3, 4):
            raise ValueError(f"expected .faces of 3 or 4 corners, got one of {count}: use triangulate()")
        (triangles if count == 3 else quads).append(corners)
        at += 1 + count
    return _split(triangles, quads)


def _meshio_faces(cells: Any) -> Any:
    """The triangles of meshio's blocks of cells."""
    blocks = list(cells.items()) if isinstance(cells, dict) else [(block.type, block.data) for block in cells]
    triangles = [np.asarray(data) for kind, data in blocks if kind == "triangle"]
    quads = [np.asarray(data) for kind, data in blocks if kind == "quad"]
    if not triangles and not quads:
        kinds = ", ".join(f"'{kind}'" for kind, _ in blocks)
        raise ValueError(f"expected cells of type 'triangle' or 'quad', got {kinds or 'none'}")
    return _split(triangles, quads)


def _split(triangles: Sequence[Any], quads: Sequence[Any]) -> Any:
    """All triangles, and two of each quad."""
    both = [np.reshape(faces, (-1, 3)) for faces in triangles]
    corners = [np.reshape(faces, (-1, 4)) for faces in quads]
    return np.concatenate(both + [quad[:, side] for quad in corners for side in ([0, 1, 2], [0, 2, 3])])


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
    # one number for each edge: numpy sorts pairs slowly, and keeps other threads waiting
    unique, inverse = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True)
    middles = vertices[np.stack(np.divmod(unique, len(vertices)), axis=1)].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = len(vertices) + inverse.reshape(-1, 3).T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([vertices, middles]), np.concatenate([np.stack(part, axis=1) for part in parts])
