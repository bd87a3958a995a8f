"""Coupled cages and skeletons: the core of Cage Rig.

Arrays are float32 or float64 of any layout; indices are integers of any width. All coordinates
are in rig space. Shapes are written (rows, columns): #M skin vertices, #C cage vertices,
#J joints. Rows are what is moved, columns what moves it.
"""

from collections.abc import Callable
from typing import Any, Literal, TypeAlias, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Doubles: TypeAlias = NDArray[np.float64]
Faces: TypeAlias = ArrayLike | tuple[ArrayLike, ArrayLike]
"""(#F, 3) vertex indices, or a pair (corner indices, face sizes) for polygons."""
LikeCage: TypeAlias = tuple[ArrayLike, Faces, int]
"""Of a generated cage: vertices (#C, 3), section after section, faces, and how many vertices a section has."""
Weights: TypeAlias = ArrayLike | tuple[ArrayLike, ArrayLike, ArrayLike]
"""(#M, #J), or a triple (indptr, indices, data)."""

__all__ = [
    "ArrayError",
    "BindJob",
    "Bones",
    "CageError",
    "CageGenerator",
    "CageRigError",
    "CagingError",
    "CagingJob",
    "Cancelled",
    "CoupledRig",
    "MethodJob",
    "PanicException",
    "Playback",
    "PoseError",
    "SkeletonError",
    "SkinError",
    "WeightsError",
    "__version__",
    "cage_sections",
    "check_cage",
    "coordinate_kinds",
    "extract_skeleton",
    "fit_cage",
    "generate_cage",
    "mean_value_coordinates",
    "skinning_methods",
]

__version__: str

class CageRigError(ValueError): ...
class CageError(CageRigError): ...
class SkinError(CageRigError): ...
class WeightsError(CageRigError): ...
class SkeletonError(CageRigError): ...
class PoseError(CageRigError): ...
class ArrayError(CageRigError): ...

class Cancelled(Exception):
    """A job was cancelled; nothing of it is left."""

class CagingError(CageRigError):
    """No cage was generated; says where the fault is, as far as it has a place."""

    node: int | None  # of the skeleton
    section: int | None  # of a cage to be like
    place: tuple[float, float, float] | None
    cancelled: bool

class PanicException(BaseException):
    """A bug in the core stopped a call; the rig that raised it refuses further calls."""

class CageCheck(TypedDict):
    turned: bool
    triangles: NDArray[np.int64]

class Options(TypedDict, total=False):
    max_anchor_ratio: float
    max_anchor_swaps: int
    locality_exponent: float
    min_singular: float
    falloff: float  # outside the cage its effect ends after so many mean cage edges
    center_sigma: float
    center_bins: int  # 0: exact, slow
    half_weights: bool  # 16-bit coordinates in frames: faster above some 100,000 vertices, within 2e-4 of the movement
    instructions: str  # those of frames: baseline, avx2, avx512 or neon; the fastest there are

class Report(TypedDict):
    cage_turned: bool
    joints_outside_hull: list[int]
    unweighted_joints: list[int]
    unweighted_vertices: int
    vertices_outside: int
    vertices_out_of_reach: int
    anchor_max_ratio: float
    anchor_swaps: int
    anchor_condition: float
    regularised: int
    joint_error_max: float
    coordinate_error_max: float

class Work(TypedDict):
    anchor_factorisations: int
    reverse_factorisations: int
    reverse_low_rank: int
    reverse_solves: int
    rest_passes: int
    rest_column_passes: int  # those of them that read few columns alone, as in a drag
    rest_shape_passes: int  # those of them that read shapes the cage goes through, as between keys
    skin_passes: int
    cage_fits: int
    center_integrations: int
    center_passes: int
    center_column_passes: int
    center_shape_passes: int

@final
class Bones:
    def __new__(
        cls,
        rest: ArrayLike,  # (#J, 4, 4), acting on columns
        tail_links: ArrayLike | None = None,  # (#links, 2): bones whose tails follow a child's joint when refit
        lengths: ArrayLike | None = None,  # (#links,) of those bones, when their tails were there
    ) -> Bones: ...
    @property
    def heads(self) -> Doubles: ...
    def transforms(self, posed: ArrayLike) -> Doubles: ...  # (#J, 4, 4); the identity where a bone rests

@final
class CoupledRig:
    def __new__(
        cls,
        skin_vertices: ArrayLike,  # (#M, 3)
        skin_faces: Faces,
        skin_weights: Weights,  # normalised at bind; a row without weights is not moved by the skeleton
        joints: ArrayLike,  # (#J, 3)
        parents: ArrayLike,  # (#J,), -1 = root, any order
        cage_vertices: ArrayLike,  # (#C, 3)
        cage_faces: Faces,
        *,
        method: str = "lbs",  # one of skinning_methods()
        coordinates: str = "mean_value",
        anchors: ArrayLike | None = None,  # (min(#M, #C),) skin vertices
        cage_coords: ArrayLike | None = None,  # (#M, #C)
        joint_coords: ArrayLike | None = None,  # (#J, #C)
        center_coords: ArrayLike | None = None,  # (#M, #C), kept for when a method needs it
        options: Options | None = None,
    ) -> CoupledRig: ...
    def pose(
        self,
        transforms: ArrayLike,  # (#J, 4, 4), acting on columns
        rest_joints: ArrayLike | None = None,  # (#J, 3), where the transforms were measured
    ) -> None: ...
    def edit_rest_cage(self, cage: ArrayLike) -> None: ...
    def edit_posed_cage(self, cage: ArrayLike) -> None: ...
    def play(
        self,
        cage: ArrayLike,  # (#C, 3)
        transforms: ArrayLike,
        rest_joints: ArrayLike | None = None,
    ) -> bool: ...  # whether anything of it was new
    def play_posed(self, cage: ArrayLike, bones: Bones, posed: ArrayLike) -> bool: ...  # (#J, 4, 4) where bones are
    def offset_rest_skin(self, offsets: ArrayLike | None) -> None: ...
    def mask_skin(self, mask: ArrayLike | None) -> None: ...  # (#M,), 0 to 1: where the cage acts
    def carry(
        self,
        cage: ArrayLike | None,  # (#C, 3), with joints or not at all
        joints: ArrayLike | None,  # (#J, 3)
    ) -> None: ...  # what a lower cage has moved this rig's rest cage and joints by
    def set_method(self, name: str) -> None: ...  # at any time; changes the posed skin alone
    def start_method(self, name: str) -> MethodJob: ...
    @property
    def method(self) -> str: ...
    @property
    def half_weights(self) -> bool: ...  # whether frames keep weights of the cage in 16 bits; set at any time
    @half_weights.setter
    def half_weights(self, half: bool) -> None: ...
    @property
    def reproducible(self) -> bool: ...  # frames are the same bit for bit whatever was before them; set at any time
    @reproducible.setter
    def reproducible(self, reproducible: bool) -> None: ...
    def posed_skins(
        self,
        cages: ArrayLike,  # (#F, #C, 3), or (#C, 3) for a still cage
        transforms: ArrayLike,  # (#F, #J, 4, 4)
        rest_joints: ArrayLike | None = None,
    ) -> NDArray[np.float32]: ...  # (#F, #M, 3); the rig stays as it is
    def posed_skin_into(self, out: NDArray[Any], start: int = 0) -> None: ...
    def rest_skin_into(self, out: NDArray[Any], start: int = 0) -> None: ...
    def posed_cage_into(self, out: NDArray[Any]) -> None: ...
    @property
    def rest_skin(self) -> Doubles: ...
    @property
    def posed_skin(self) -> Doubles: ...
    @property
    def rest_cage(self) -> Doubles: ...
    @property
    def posed_cage(self) -> Doubles: ...
    @property
    def joints(self) -> Doubles: ...
    @property
    def posed_joints(self) -> Doubles: ...
    @property
    def transforms(self) -> Doubles: ...
    def refit_pose(self, bones: Bones) -> Doubles: ...  # (#J, 4, 4): poses each in its own rest space
    def cage_influence(self, vertices: ArrayLike) -> NDArray[np.float32]: ...  # (#M,)
    @property
    def cage_coords(self) -> Doubles: ...
    @property
    def joint_coords(self) -> Doubles: ...
    @property
    def center_coords(self) -> Doubles | None: ...  # None until given or needed by the method
    @property
    def anchors(self) -> NDArray[np.int64]: ...
    @property
    def size(self) -> float: ...
    @property
    def report(self) -> Report: ...
    @property
    def work(self) -> Work: ...
    def _panic_for_tests(self) -> None: ...

@final
class Playback:
    """Frames of a rig from arrays into arrays, which it keeps; all of them are float32, and skin is contiguous."""

    def __new__(
        cls,
        rig: CoupledRig,
        bones: Bones,
        refit: Bones | None = None,  # those that refit_pose is for
        *,
        cage: NDArray[np.float32],  # (#C, 3), read
        posed: NDArray[np.float32],  # (#J, 4, 4), where bones are, read
        skin: NDArray[np.float32],  # (#M, 3), written, as the next
        posed_cage: NDArray[np.float32],  # (#C, 3)
        refit_pose: NDArray[np.float32],  # (#J, 4, 4), as CoupledRig.refit_pose gives it
    ) -> Playback: ...
    def play(
        self,
        influence: float = 1.0,  # the part of the cage's movement that counts
        *,
        fitted: bool = True,  # posed_cage is written too
        again: bool = False,  # written where nothing was new too
    ) -> bool: ...  # whether anything of it was new

@final
class BindJob:
    """A bind in a thread of its own, begun at once; the rig equals CoupledRig(...) to the last bit.

    Arguments are checked before it begins, and what they hold is copied. Dropping the job cancels it. A cancel takes
    effect within some 50 ms, later where a cage has hundreds of vertices: their decompositions can't be interrupted.
    """

    def __new__(
        cls,
        skin_vertices: ArrayLike,  # (#M, 3)
        skin_faces: Faces,
        skin_weights: Weights,  # normalised at bind; a row without weights is not moved by the skeleton
        joints: ArrayLike,  # (#J, 3)
        parents: ArrayLike,  # (#J,), -1 = root, any order
        cage_vertices: ArrayLike,  # (#C, 3)
        cage_faces: Faces,
        *,
        method: str = "lbs",  # one of skinning_methods()
        coordinates: str = "mean_value",
        anchors: ArrayLike | None = None,  # (min(#M, #C),) skin vertices
        cage_coords: ArrayLike | None = None,  # (#M, #C)
        joint_coords: ArrayLike | None = None,  # (#J, #C)
        center_coords: ArrayLike | None = None,  # (#M, #C), kept for when a method needs it
        options: Options | None = None,
    ) -> BindJob: ...
    @property
    def progress(self) -> float: ...  # 0 to 1, never falls
    @property
    def stage(self) -> str: ...  # what is being computed, for people; empty before it begins
    @property
    def done(self) -> bool: ...  # whether result() answers at once
    def cancel(self) -> None: ...  # result() raises Cancelled then; what is done stays done
    def wait(self, seconds: float | None = None) -> bool: ...  # whether it is done
    def result(self) -> CoupledRig: ...  # waits; raises what the bind raises
    @staticmethod
    def _panic_for_tests() -> BindJob: ...

@final
class MethodJob:
    """A change of a rig's skinning method: what it needs is computed in a thread, if it is not there already.

    The rig can be used meanwhile and keeps its method until result() is called. Dropping the job cancels it.
    """

    @property
    def method(self) -> str: ...  # that the rig is to have
    @property
    def progress(self) -> float: ...
    @property
    def stage(self) -> str: ...
    @property
    def done(self) -> bool: ...
    def cancel(self) -> None: ...
    def wait(self, seconds: float | None = None) -> bool: ...
    def result(self) -> None: ...  # waits, then changes the method

def mean_value_coordinates(points: ArrayLike, cage_vertices: ArrayLike, cage_faces: Faces) -> Doubles: ...
def check_cage(cage_vertices: ArrayLike, cage_faces: Faces) -> CageCheck: ...
def skinning_methods() -> list[str]: ...
def coordinate_kinds() -> list[str]: ...

class CagingOptions(TypedDict, total=False):
    placement: Literal["automatic", "joints"]  # of bending nodes where none are given
    grid: int  # cells a side of the window in which a section's field is solved
    corners: int  # of a section
    reach: float  # gaps narrower than this push; relative to the skin's diagonal, as the next
    clearance: float  # no gap ends narrower
    tightness: float
    rounds: int  # of tightening
    triangles: bool  # instead of quads
    detail: float  # leaves thinner than this, relative to the diagonal, get no branch
    asymmetric: bool  # leave a symmetric character's cage as it comes

class Section(TypedDict):
    kind: Literal["bending", "leaf"]
    place: Doubles  # (3,), on the skeleton
    point: Doubles  # (3,), beside it, in the middle of the skin
    direction: Doubles  # (3,)
    radius: float
    node: int  # the nearest node of the skeleton
    arc: int  # sections of one arc are joined in order
    ring: Doubles  # (n, 3)
    corners: Doubles  # (corners, 3)

class Arc(TypedDict):
    path: Doubles  # (n, 3)
    nodes: NDArray[np.int64]  # (n,), of the skeleton handed in, -1 between them

class Repairs(TypedDict):
    welded: int
    left_out: int
    turned: int
    inside_out: bool
    parts: int

class CagingReport(TypedDict):
    sections: list[Section]
    vertex_sections: NDArray[np.int64]  # (#C,)
    kept_vertices: int  # that are where an earlier cage had them
    dropped_nodes: list[int]
    repairs: Repairs
    volume_ratio: float
    mean_distance: float  # relative to the skin's diagonal, as the next
    clearance: float
    min_angle: float  # degrees
    genus: int
    mirror: NDArray[np.int64] | None  # (#C,): each vertex's image in x
    arrangement: NDArray[np.int64] | None  # like another cage: the arcs in its order, from 1, negative where turned
    timings: dict[str, float]  # seconds

def generate_cage(
    vertices: ArrayLike,  # (#V, 3)
    faces: Faces,  # closed
    nodes: ArrayLike,  # (#N, 3), of the skeleton
    edges: ArrayLike,  # (#E, 2)
    *,
    bending_nodes: ArrayLike | None = None,  # (#B, 3), near the skeleton
    options: CagingOptions | None = None,
    like: LikeCage | None = None,  # its faces are taken over, index for index
    progress: Callable[[str, float], object] | None = None,  # every stage, part; a false answer but None cancels
) -> tuple[Doubles, NDArray[np.int64] | tuple[NDArray[np.int64], NDArray[np.int64]], CagingReport]: ...
def cage_sections(
    vertices: ArrayLike,
    faces: Faces,
    nodes: ArrayLike,
    edges: ArrayLike,
    *,
    bending_nodes: ArrayLike | None = None,
    options: CagingOptions | None = None,
) -> list[Section]: ...
def fit_cage(
    vertices: ArrayLike,  # (#V, 3)
    faces: Faces,  # closed
    nodes: ArrayLike,  # (#N, 3), of the skeleton
    edges: ArrayLike,  # (#E, 2)
    cage_vertices: ArrayLike,  # (#C, 3), about where they are to be
    cage_faces: Faces,  # closed; taken over, index for index
    *,
    options: CagingOptions | None = None,
    progress: Callable[[str, float], object] | None = None,  # every stage, part; a false answer but None cancels
) -> tuple[Doubles, NDArray[np.int64] | tuple[NDArray[np.int64], NDArray[np.int64]], CagingReport]: ...
def extract_skeleton(vertices: ArrayLike, faces: Faces) -> tuple[Doubles, NDArray[np.int64]]: ...  # nodes, edges

@final
class CagingJob:
    """A cage generated in a thread of its own: takes what generate_cage takes, and begins at once."""

    def __new__(
        cls,
        vertices: ArrayLike,
        faces: Faces,
        nodes: ArrayLike,
        edges: ArrayLike,
        *,
        bending_nodes: ArrayLike | None = None,
        options: CagingOptions | None = None,
        like: LikeCage | None = None,
    ) -> CagingJob: ...
    @property
    def progress(self) -> float: ...  # 0 to 1, never falls
    @property
    def stage(self) -> str: ...
    @property
    def done(self) -> bool: ...
    def cancel(self) -> None: ...
    def wait(self, seconds: float | None = None) -> bool: ...
    def result(
        self,
    ) -> tuple[Doubles, NDArray[np.int64] | tuple[NDArray[np.int64], NDArray[np.int64]], CagingReport]: ...

@final
class CageGenerator:
    """A skin and its skeleton, kept: another call traces only the sections that its bending nodes changed."""

    def __new__(
        cls,
        vertices: ArrayLike,
        faces: Faces,
        nodes: ArrayLike,
        edges: ArrayLike,
        *,
        options: CagingOptions | None = None,
    ) -> CageGenerator: ...
    def sections(self, bending_nodes: ArrayLike | None = None, *, like: LikeCage | None = None) -> list[Section]: ...
    def generate(
        self,
        bending_nodes: ArrayLike | None = None,
        earlier: tuple[ArrayLike | None, ArrayLike, Faces] | None = None,  # bending nodes, vertices (#C, 3), faces
        *,
        like: LikeCage | None = None,
        arrangement: ArrayLike | None = None,  # of the report of an earlier cage that was like another one
    ) -> CagingJob: ...
    def fit(self, cage_vertices: ArrayLike, cage_faces: Faces) -> CagingJob: ...  # as fit_cage
    @property
    def arcs(self) -> list[Arc]: ...  # the skeleton as it is used: clipped, recentred, pruned
    @property
    def repairs(self) -> Repairs: ...
