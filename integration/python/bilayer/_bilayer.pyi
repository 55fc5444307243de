from typing import Any, Dict, List, Optional, Sequence, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilayer._types import Accuracy, MeshLike, Method, Mode, Path, Progress, Sign, Storage
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

# A Pose, a matrix of shape (4, 4), or None.
_PoseLike = Union[Pose, ArrayLike, None]
_Floats = NDArray[np.float32]
_Doubles = NDArray[np.float64]
_Bools = NDArray[np.bool_]

__version__: str
class Cancelled(RuntimeError): ...
class DeviceError(RuntimeError): ...
class Mesh:
    def __init__(self, vertices: ArrayLike, faces: ArrayLike, origin: Optional[ArrayLike] = None) -> None: ...
    @property
    def vertices(self) -> _Floats: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def origin(self) -> _Doubles: ...
    @property
    def bounds(self) -> _Floats: ...
    def welded(self) -> Mesh: ...
    def transformed(self, matrix: ArrayLike) -> Mesh: ...
    def save(self, path: Path) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Mesh: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Mesh: ...

class LevelSet:
    @property
    def voxel_size(self) -> float: ...
    @property
    def origin(self) -> _Doubles: ...
    @property
    def exterior_width(self) -> float: ...
    @property
    def interior_width(self) -> float: ...
    @property
    def active_voxels(self) -> int: ...
    @property
    def memory_bytes(self) -> int: ...
    @property
    def method(self) -> str: ...
    @property
    def sign(self) -> str: ...
    @property
    def sign_reason(self) -> str: ...
    @property
    def error_bound(self) -> float: ...
    @property
    def mesh_hash(self) -> int: ...
    @property
    def has_triangles(self) -> bool: ...
    @property
    def metadata(self) -> Dict[str, Any]: ...
    def to_numpy(self, padding: int = 1) -> Dense: ...
    def sparse(self) -> Sparse: ...
    def surface(self, isovalue: float = 0, adaptivity: float = 0) -> Mesh: ...
    def extended(self, distance: Optional[float] = None) -> LevelSet: ...
    def save(self, path: Path, half_float: bool = False) -> None: ...
    @staticmethod
    def from_numpy(
        values: ArrayLike,
        origin: ArrayLike = ...,
        spacing: float = 1,
        *,
        half_width: Optional[ArrayLike] = None,
        field_origin: ArrayLike = ...,
    ) -> LevelSet: ...
    @staticmethod
    def load(path: Path) -> LevelSet: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> LevelSet: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> LevelSet: ...

class Field:
    def __init__(
        self,
        level_set: LevelSet,
        mesh: Optional[MeshLike] = None,
        storage: Storage = "float32",
        keep_level_set: bool = True,
    ) -> None: ...
    def sample(self, points: ArrayLike) -> Samples: ...
    def closest(self, points: ArrayLike, max_distance: ArrayLike = ...) -> ClosestPoints: ...
    def inside(self, points: ArrayLike) -> _Bools: ...
    def raycast(self, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike = ...) -> Hits: ...
    def sphere_cast(
        self, origins: ArrayLike, directions: ArrayLike, radii: ArrayLike, max_distance: ArrayLike = ...
    ) -> Hits: ...
    def segment(self, start: ArrayLike, end: ArrayLike) -> Hits: ...
    def overlaps_sphere(self, centres: ArrayLike, radii: ArrayLike) -> _Bools: ...
    def overlaps_box(
        self, centres: ArrayLike, half_sizes: ArrayLike, rotations: Optional[ArrayLike] = None
    ) -> _Bools: ...
    @property
    def voxel_size(self) -> float: ...
    @property
    def origin(self) -> _Doubles: ...
    @property
    def exterior_width(self) -> float: ...
    @property
    def interior_width(self) -> float: ...
    @property
    def bounds(self) -> _Floats: ...
    @property
    def mesh(self) -> Optional[Mesh]: ...
    @property
    def memory_bytes(self) -> int: ...
    def __copy__(self) -> Field: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Field: ...

class Pose:
    def __init__(self, position: ArrayLike = ..., rotation: ArrayLike = ...) -> None: ...
    @staticmethod
    def from_matrix(matrix: ArrayLike) -> Pose: ...
    @property
    def position(self) -> _Floats: ...
    @property
    def rotation(self) -> _Floats: ...
    @property
    def matrix(self) -> _Floats: ...
    def to_world(self, points: ArrayLike) -> _Floats: ...
    def to_body(self, points: ArrayLike) -> _Floats: ...
    def inverse(self) -> Pose: ...
    def __matmul__(self, other: Pose) -> Pose: ...
    def __hash__(self) -> int: ...
    def __eq__(self, other: object) -> bool: ...
    def __copy__(self) -> Pose: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Pose: ...

class Collider:
    def __init__(
        self,
        mesh: MeshLike,
        level_set: LevelSet,
        *,
        point_spacing_voxels: float = 2,
        margin: Optional[float] = None,
        accuracy: Accuracy = "exact-near-features",
    ) -> None: ...
    @staticmethod
    def from_level_set(level_set: LevelSet) -> Collider: ...
    @property
    def mesh(self) -> Mesh: ...
    @property
    def field(self) -> Field: ...
    @property
    def exact_field(self) -> Field: ...
    @property
    def margin(self) -> float: ...
    @property
    def mass(self) -> MassProperties: ...
    def __copy__(self) -> Collider: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Collider: ...

class ContactCache:
    def __init__(self) -> None: ...

class Shape:
    @staticmethod
    def sphere(radius: float) -> Shape: ...
    @staticmethod
    def box(half_extents: ArrayLike) -> Shape: ...
    @staticmethod
    def capsule(radius: float, half_height: float) -> Shape: ...
    @staticmethod
    def cylinder(radius: float, half_height: float) -> Shape: ...
    @staticmethod
    def cone(radius: float, half_height: float) -> Shape: ...
    @staticmethod
    def hull(points: ArrayLike, radius: float = 0) -> Shape: ...
    @staticmethod
    def spheres(centres: ArrayLike, radii: ArrayLike) -> Shape: ...
    @staticmethod
    def plane(normal: ArrayLike, offset: float = 0) -> Shape: ...
    @staticmethod
    def triangles(mesh: MeshLike) -> Shape: ...
    def __copy__(self) -> Shape: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Shape: ...

class Obstacle:
    @property
    def distance(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def open_faces(self) -> _Floats: ...
    @property
    def open_volume(self) -> _Floats: ...
    @property
    def origin(self) -> _Doubles: ...
    @property
    def voxel_size(self) -> float: ...
    def save(self, path: Path) -> None: ...
    def __copy__(self) -> Obstacle: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Obstacle: ...

def read_mesh(path: Path) -> Mesh: ...
def inspect(mesh: MeshLike, wall: float = 0) -> MeshReport: ...
@overload
def build(
    mesh: MeshLike,
    *,
    resolution: float,
    voxel_size: None = None,
    half_width: Optional[float] = None,
    half_width_voxels: Optional[float] = None,
    exterior_width_voxels: Optional[float] = None,
    interior_width_voxels: Optional[float] = None,
    method: Method = "exact",
    sign: Sign = "auto",
    gap_voxels: float = 2,
    unite: bool = False,
    triangles: bool = False,
    threads: int = 0,
    device: str = "cpu",
    delta: float = 0.5,
    epsilon: float = 1,
    neighbourhood: int = 2,
    max_subdivision: int = 32,
    progress: Optional[Progress] = None,
) -> LevelSet: ...
@overload
def build(
    mesh: MeshLike,
    *,
    resolution: None = None,
    voxel_size: float,
    half_width: Optional[float] = None,
    half_width_voxels: Optional[float] = None,
    exterior_width_voxels: Optional[float] = None,
    interior_width_voxels: Optional[float] = None,
    method: Method = "exact",
    sign: Sign = "auto",
    gap_voxels: float = 2,
    unite: bool = False,
    triangles: bool = False,
    threads: int = 0,
    device: str = "cpu",
    delta: float = 0.5,
    epsilon: float = 1,
    neighbourhood: int = 2,
    max_subdivision: int = 32,
    progress: Optional[Progress] = None,
) -> LevelSet: ...
@overload
def rebuild(
    level_set: LevelSet,
    old_mesh: MeshLike,
    new_mesh: MeshLike,
    moved: Optional[ArrayLike] = None,
    *,
    resolution: float,
    voxel_size: None = None,
    half_width: Optional[float] = None,
    half_width_voxels: Optional[float] = None,
    exterior_width_voxels: Optional[float] = None,
    interior_width_voxels: Optional[float] = None,
    method: Method = "exact",
    sign: Sign = "auto",
    gap_voxels: float = 2,
    unite: bool = False,
    triangles: bool = False,
    threads: int = 0,
    delta: float = 0.5,
    epsilon: float = 1,
    neighbourhood: int = 2,
    max_subdivision: int = 32,
    progress: Optional[Progress] = None,
) -> LevelSet: ...
@overload
def rebuild(
    level_set: LevelSet,
    old_mesh: MeshLike,
    new_mesh: MeshLike,
    moved: Optional[ArrayLike] = None,
    *,
    resolution: None = None,
    voxel_size: float,
    half_width: Optional[float] = None,
    half_width_voxels: Optional[float] = None,
    exterior_width_voxels: Optional[float] = None,
    interior_width_voxels: Optional[float] = None,
    method: Method = "exact",
    sign: Sign = "auto",
    gap_voxels: float = 2,
    unite: bool = False,
    triangles: bool = False,
    threads: int = 0,
    delta: float = 0.5,
    epsilon: float = 1,
    neighbourhood: int = 2,
    max_subdivision: int = 32,
    progress: Optional[Progress] = None,
) -> LevelSet: ...
def devices() -> List[Dict[str, Any]]: ...
def mass_properties(solid: Union[LevelSet, MeshLike]) -> MassProperties: ...
def with_body(
    level_set: LevelSet,
    mesh: MeshLike,
    *,
    point_spacing_voxels: float = 2,
    margin: Optional[float] = None,
    accuracy: Accuracy = "exact-near-features",
    keep_mesh: bool = True,
) -> LevelSet: ...
def collide(
    a: Union[Collider, Shape],
    pose_a: _PoseLike,
    b: Union[Collider, Shape],
    pose_b: _PoseLike,
    *,
    margin: float = 0,
    exact: bool = False,
    scale_a: float = 1,
    scale_b: float = 1,
    motion_a: Optional[ArrayLike] = None,
    motion_b: Optional[ArrayLike] = None,
    min_normal_cosine: float = 0.3,
    min_normal_cosine_apart: float = 0.9,
    keep_oblique_edges: bool = False,
    reduced: bool = False,
    cache: Optional[ContactCache] = None,
) -> Contacts: ...
def distance(
    a: Union[Collider, Shape],
    pose_a: _PoseLike,
    b: Union[Collider, Shape],
    pose_b: _PoseLike,
    *,
    scale_a: float = 1,
    scale_b: float = 1,
    max_distance: float = ...,
) -> BodyDistance: ...
def distances(
    colliders: Union[Collider, Sequence[Collider]],
    poses: Union[Sequence[_PoseLike], NDArray[Any]],
    pairs: ArrayLike,
    max_distance: float = ...,
) -> _Floats: ...
def time_of_impact(
    a: Union[Collider, Shape],
    pose_a: _PoseLike,
    motion_a: Optional[ArrayLike],
    b: Union[Collider, Shape],
    pose_b: _PoseLike,
    motion_b: Optional[ArrayLike],
    *,
    scale_a: float = 1,
    scale_b: float = 1,
    tolerance: float = 0,
    penetration: bool = False,
) -> Impact: ...
def seed(
    liquid: LevelSet,
    body: Union[LevelSet, MeshLike],
    pose: _PoseLike = None,
    scale: ArrayLike = 1,
    mode: Mode = "unite",
    unite_solids: bool = True,
) -> Seeded: ...
def particles(
    liquid: Union[LevelSet, Field],
    pose: _PoseLike = None,
    scale: ArrayLike = 1,
    voxel_size: Optional[float] = None,
    per_voxel: int = 8,
    seed: int = 0,
) -> _Floats: ...
def obstacle(
    solid: Union[LevelSet, MeshLike],
    voxel_size: float,
    pose: _PoseLike = None,
    scale: ArrayLike = 1,
    velocity: ArrayLike = ...,
    angular_velocity: ArrayLike = ...,
    half_width_voxels: float = 3,
) -> Obstacle: ...
