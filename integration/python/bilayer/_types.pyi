# SPDX-License-Identifier: Apache-2.0
from os import PathLike
from typing import Any, Callable, List, Literal, Optional, Protocol, SupportsFloat, Tuple, Union

from numpy.typing import ArrayLike

from bilayer._bilayer import Mesh

class _VerticesAndFaces(Protocol):
    """As trimesh."""

    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

class _VerticesAndTriangles(Protocol):
    """As Open3D's legacy meshes."""

    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...

class _VertexAndTriangle(Protocol):
    """As Open3D's tensor meshes."""

    @property
    def vertex(self) -> Any: ...
    @property
    def triangle(self) -> Any: ...

class _PointsAndFaces(Protocol):
    """As PyVista's PolyData."""

    @property
    def points(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

class _PointsAndCells(Protocol):
    """As meshio."""

    @property
    def points(self) -> Any: ...
    @property
    def cells(self) -> Any: ...

# A Mesh, or what as_mesh() takes.
MeshLike = Union[
    Mesh,
    _VerticesAndFaces,
    _VerticesAndTriangles,
    _VertexAndTriangle,
    _PointsAndFaces,
    _PointsAndCells,
    Tuple[ArrayLike, ArrayLike],
    List[Any],  # of the same two
]

# Numbers of Python and numpy.
Real = SupportsFloat
Path = Union[str, bytes, PathLike[str]]
Progress = Callable[[float], Optional[bool]]
Method = Literal["exact", "double-layer", "pseudonormal", "prism"]
Sign = Literal["auto", "normals", "winding", "flood"]
Accuracy = Literal["samples", "exact-near-features", "exact"]
Storage = Literal["float32", "fixed16"]
Mode = Literal["unite", "intersect", "subtract"]
