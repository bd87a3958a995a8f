"""The biped's surface: closed parts modelled as distance fields.

The body (head, hands) and the outfit (hat, hoodie, trousers, shoes).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .biped_skeleton import (
    ELBOW,
    FINGERS,
    HAND_ALONG,
    HAND_BACK,
    HAND_FRONT,
    SHOULDER,
    WRIST,
    finger_joints,
    hand_point,
)
from .fields import Field, chain, cone, ellipsoid, halfspace, intersection, mirrored, ring, slab, union
from .parts import Part, mirror_part
from .surface_nets import mesh_field, symmetrise

TORSO_BONES = ("hips", "spine.001", "spine.002", "chest", "neck", "clavicle.L", "clavicle.R")
ARM_BONES = ("upper_arm.L", "forearm.L", "upper_arm.R", "forearm.R")
LEG_BONES = ("thigh.L", "shin.L", "thigh.R", "shin.R")
HAND_BONES = ("forearm.L", "hand.L", *(f"{finger}.{k:02d}.L" for finger in FINGERS for k in (1, 2, 3)))


def body_parts() -> list[Part]:
    """Head with face, and hands."""
    hand = _part(
        "hand.L",
        hand_field(),
        (0.42, -0.15, 0.62),
        (0.75, 0.10, 0.94),
        cell=0.0090,
        material="Skin",
        bones=HAND_BONES,
        symmetric=False,
    )
    face = [
        _sided("eye.L", ellipsoid((0.078, -0.173, 1.538), (0.029, 0.024, 0.043)), cell=0.009, material="Ink"),
        _sided("glint.L", ellipsoid((0.087, -0.1935, 1.555), (0.0090, 0.005, 0.0105)), cell=0.0045, material="White"),
        _sided(
            "brow.L",
            chain([(0.052, -0.183, 1.609), (0.082, -0.170, 1.616), (0.112, -0.157, 1.606)], [0.0075, 0.0095, 0.006]),
            cell=0.006,
            material="Ink",
        ),
    ]
    smile = chain(
        [(0.0, -0.188, 1.430), (0.020, -0.188, 1.4325), (0.040, -0.188, 1.440), (0.054, -0.188, 1.451)],
        [0.0068, 0.0068, 0.0062, 0.005],
    )
    mouth = _part(
        "mouth",
        mirrored(smile),
        (-0.07, -0.21, 1.41),
        (0.07, -0.16, 1.47),
        cell=0.0050,
        material="Ink",
        bones=("head",),
    )
    head = _part(
        "head", _head(), (-0.28, -0.27, 1.14), (0.28, 0.25, 1.82), cell=0.0185, material="Skin", bones=("neck", "head")
    )
    sided = [hand, *face]
    return [head, mouth, *sided, *(mirror_part(part, part.name[:-2] + ".R") for part in sided)]


def outfit_parts() -> list[Part]:
    """Hat, hoodie with hood and strings, trousers, shoes with soles."""
    torso = _hoodie()
    pocket = intersection([lambda p: torso(p) - 0.009, _pocket_outline()], 0.012)
    strings = chain([(0.050, -0.139, 1.205), (0.054, -0.163, 1.15), (0.054, -0.172, 1.085)], [0.0068, 0.0068, 0.0085])
    shoe_bones = ("shin.L", "foot.L", "toe.L")
    sided = [
        _part(
            "string.L",
            strings,
            (0.02, -0.21, 1.05),
            (0.09, -0.10, 1.24),
            cell=0.006,
            material="White",
            bones=TORSO_BONES[:5],
            symmetric=False,
        ),
        _part(
            "shoe.L",
            _shoe(),
            (0.03, -0.24, 0.0),
            (0.23, 0.13, 0.24),
            cell=0.0155,
            material="Shoe",
            bones=shoe_bones,
            symmetric=False,
        ),
        _part(
            "sole.L",
            _sole(),
            (0.02, -0.24, -0.01),
            (0.23, 0.14, 0.06),
            cell=0.0145,
            material="White",
            bones=shoe_bones[1:],
            symmetric=False,
        ),
    ]
    return [
        _part(
            "hoodie",
            torso,
            (-0.62, -0.26, 0.66),
            (0.62, 0.26, 1.33),
            cell=0.0188,
            material="Hoodie",
            bones=TORSO_BONES + ARM_BONES,
        ),
        _part(
            "pocket",
            pocket,
            (-0.16, -0.26, 0.74),
            (0.16, 0.02, 0.97),
            cell=0.017,
            material="Trim",
            bones=TORSO_BONES[:4],
        ),
        _part(
            "hood",
            _hood(),
            (-0.24, -0.20, 1.07),
            (0.24, 0.27, 1.36),
            cell=0.018,
            material="Hoodie",
            bones=("chest", "neck"),
        ),
        _part(
            "trousers",
            _trousers(),
            (-0.25, -0.17, 0.09),
            (0.25, 0.19, 0.88),
            cell=0.0182,
            material="Trousers",
            bones=("hips", "spine.001", *LEG_BONES),
        ),
        _part("hat", _hat(), (-0.27, -0.27, 1.52), (0.27, 0.27, 1.85), cell=0.019, material="Hat", bones=("head",)),
        _part("brim", _brim(), (-0.28, -0.27, 1.54), (0.28, 0.27, 1.76), cell=0.018, material="Trim", bones=("head",)),
        _part(
            "pompom",
            ellipsoid((0.0, 0.035, 1.838), (0.052, 0.052, 0.048)),
            (-0.07, -0.04, 1.77),
            (0.07, 0.11, 1.91),
            cell=0.015,
            material="Trim",
            bones=("head",),
        ),
        *sided,
        *(mirror_part(part, part.name[:-2] + ".R") for part in sided),
    ]


def _part(
    name: str,
    field: Field,
    low: Sequence[float],
    high: Sequence[float],
    *,
    cell: float,
    material: str,
    bones: tuple[str, ...],
    symmetric: bool = True,
) -> Part:
    vertices, faces = mesh_field(field, np.asarray(low), np.asarray(high), cell=cell)
    return Part(name, symmetrise(vertices) if symmetric else vertices, faces, material, bones)


def _sided(name: str, field: Field, *, cell: float, material: str) -> Part:
    return _part(
        name,
        field,
        (0.0, -0.23, 1.48),
        (0.15, -0.11, 1.65),
        cell=cell,
        material=material,
        bones=("head",),
        symmetric=False,
    )


def _head() -> Field:
    skull = ellipsoid((0.0, 0.005, 1.575), (0.200, 0.190, 0.205))
    jaw = ellipsoid((0.0, -0.025, 1.480), (0.188, 0.165, 0.130))
    ear = ellipsoid((0.205, 0.015, 1.520), (0.030, 0.042, 0.056))
    nose = ellipsoid((0.0, -0.200, 1.497), (0.034, 0.032, 0.027))
    neck = cone((0.0, 0.015, 1.24), (0.0, 0.005, 1.42), 0.074, 0.070)
    return mirrored(union([union([skull, jaw], 0.10), neck, ear, nose], 0.022))


def hand_field() -> Field:
    """The left hand, from the wrist."""
    frame = np.stack([HAND_ALONG, HAND_FRONT, HAND_BACK])
    middle = hand_point(0.058, 0.0)
    box = ellipsoid((0.0, 0.0, 0.0), (0.062, 0.062, 0.034))

    def palm(p: np.ndarray) -> np.ndarray:
        return box((p - middle) @ frame.T)

    wrist = cone(WRIST - 0.045 * HAND_ALONG, hand_point(0.03, 0.0), 0.036, 0.036)
    knuckles = [
        cone(hand_point(0.045, side), finger_joints(finger)[0], 0.026, 0.021)
        for finger, side in (("index", 0.026), ("middle", 0.0), ("ring", -0.026))
    ]
    fingers = union([chain(finger_joints(finger), [0.0195, 0.0185, 0.018, 0.0165]) for finger in FINGERS[1:]])
    thumb = chain([hand_point(0.03, 0.012), *finger_joints("thumb")], [0.026, 0.0245, 0.021, 0.0195, 0.0175], 0.006)
    base = union([union([palm, wrist], 0.03), *knuckles], 0.014)
    return union([union([base, fingers], 0.010), thumb], 0.030)


def _hoodie() -> Field:
    chest = cone((0.0, 0.008, 1.115), (0.105, 0.006, 1.125), 0.128, 0.105)
    waist = ellipsoid((0.0, 0.0, 0.935), (0.196, 0.170, 0.215))
    shoulder = cone((0.06, 0.008, 1.165), SHOULDER, 0.088, 0.078)
    toward = WRIST - ELBOW
    sleeve = chain([SHOULDER, ELBOW, ELBOW + 0.72 * toward], [0.080, 0.067, 0.071], 0.02)
    cuff = cone(ELBOW + 0.90 * toward, WRIST, 0.054, 0.050)
    hem = ring((0.0, 0.004, 0.765), np.eye(3), radii=(0.148, 0.128), thickness=0.027, height=1.35)
    inside = ellipsoid((0.0, 0.004, 0.765), (0.158, 0.138, 0.046))
    body = union([waist, chest, shoulder, sleeve], 0.055)
    return mirrored(union([body, union([hem, inside], 0.05), cuff], 0.014))


def _pocket_outline() -> Field:
    planes = [
        halfspace((0.0, 0.0, 0.790), (0.0, 0.0, -1.0)),
        halfspace((0.0, 0.0, 0.925), (0.0, 0.0, 1.0)),
        halfspace((0.118, 0.0, 0.80), (1.0, 0.0, 0.0)),
        halfspace((0.098, 0.0, 0.90), (0.85, 0.0, 0.55)),
        halfspace((0.0, -0.06, 0.0), (0.0, 1.0, 0.0)),
    ]
    return mirrored(intersection(planes, 0.02))


def _hood() -> Field:
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.945, 0.327], [0.0, -0.327, 0.945]])
    collar = ring((0.0, 0.012, 1.245), tilt, radii=(0.118, 0.122), thickness=0.040, height=1.0)
    bag = ellipsoid((0.0, 0.150, 1.205), (0.105, 0.060, 0.098))
    return mirrored(union([collar, bag], 0.06))


def _trousers() -> Field:
    hips = ellipsoid((0.0, 0.010, 0.735), (0.168, 0.138, 0.105))
    leg = chain([(0.096, 0.010, 0.690), (0.112, -0.002, 0.410), (0.118, 0.018, 0.190)], [0.097, 0.083, 0.084], 0.02)
    cuff = cone((0.118, 0.020, 0.165), (0.118, 0.021, 0.160), 0.083)
    cuff_band = ring((0.118, 0.021, 0.145), np.eye(3), radii=(0.068, 0.068), thickness=0.024, height=1.2)
    return mirrored(
        union(
            [union([hips, leg], 0.05), intersection([cuff, halfspace((0, 0, 0.118), (0, 0, -1))], 0.02), cuff_band],
            0.008,
        )
    )


def _hat() -> Field:
    dome = ellipsoid((0.0, 0.012, 1.590), (0.215, 0.208, 0.222))
    return mirrored(intersection([dome, halfspace((0.0, 0.0, 1.640), (0.0, -0.18, -1.0))], 0.02))


def _brim() -> Field:
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.984, -0.177], [0.0, 0.177, 0.984]])
    band = ring((0.0, 0.010, 1.650), tilt, radii=(0.200, 0.194), thickness=0.025, height=1.6)
    return mirrored(union([band, ellipsoid((0.0, 0.010, 1.650), (0.195, 0.189, 0.062))], 0.06))


def _shoe() -> Field:
    heel = ellipsoid((0.116, 0.035, 0.068), (0.064, 0.078, 0.070))
    toe = ellipsoid((0.125, -0.115, 0.055), (0.074, 0.092, 0.052))
    ankle = cone((0.116, 0.025, 0.08), (0.116, 0.024, 0.150), 0.060, 0.060)
    upper = union([union([heel, toe], 0.09), ankle], 0.03)
    return intersection([upper, halfspace((0.0, 0.0, 0.022), (0.0, 0.0, -1.0))], 0.01)


def _sole() -> Field:
    return slab((0.116, 0.042), (0.126, -0.122), radii=(0.072, 0.086), low=0.0, high=0.040, bevel=0.012)
