"""Cars and pedestrians, at the origin of their own frame with x ahead and z up."""

import numpy as np

from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.objects.shapes import boxes, cones, ellipsoids
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_BODIES = {
    # Length, width, height and bonnet height [m]; start and end of the cabin, as fractions of the
    # length from the rear.
    "hatchback": (3.9, 1.70, 1.48, 0.90, 0.02, 0.72),
    "saloon": (4.6, 1.80, 1.45, 0.92, 0.16, 0.72),
    "estate": (4.7, 1.82, 1.50, 0.93, 0.02, 0.70),
    "off-roader": (4.6, 1.90, 1.75, 1.05, 0.02, 0.72),
    "van": (5.2, 1.98, 2.10, 1.15, 0.01, 0.86),
}
_FREQUENCIES = (0.32, 0.24, 0.18, 0.16, 0.10)
_GLASS = 0.6
"""Ratio of pulses that the window of a car does not return."""


def car(rng: np.random.Generator) -> Surfaces:
    """Generate a car of a random type: body, cabin, glass, wheels and mirrors."""
    body = _BODIES[str(rng.choice(list(_BODIES), p=_FREQUENCIES))]
    length, width, height, bonnet = body[:4] * rng.normal(1.0, 0.03, 4)
    paint = float(rng.choice([0.0, 0.05, 0.35], p=[0.6, 0.25, 0.15]))
    rear, front = (np.array(body[4:]) - 0.5) * length
    sill = rng.uniform(0.2, 0.3)
    half = 0.5 * width
    shell = boxes(
        [
            [0.0, 0.0, 0.5 * (sill + bonnet)],
            [0.0, 0.0, 0.55],
            [0.5 * (rear + front) - 0.05, 0.0, 0.5 * (bonnet + height)],
        ],
        [
            [0.5 * length - 0.06, half, 0.5 * (bonnet - sill)],
            [0.5 * length, half - 0.06, 0.14],
            [0.5 * (front - rear) - 0.35, half - 0.13, 0.5 * (height - bonnet)],
        ],
        SurfaceClass.CAR,
        loss=paint,
    )
    return Surfaces.joined(
        [
            shell,
            _glass(rear, front, half, bonnet, height),
            _wheels(length, half),
            ellipsoids(
                [
                    [front - 0.3, half + 0.08, bonnet + 0.06],
                    [front - 0.3, -half - 0.08, bonnet + 0.06],
                ],
                [0.07, 0.1, 0.07],
                SurfaceClass.CAR,
            ),
        ]
    )


def _glass(rear: float, front: float, half: float, bonnet: float, height: float) -> Surfaces:
    """Return windscreen, rear window and side windows."""
    rise = height - bonnet
    parts: list[Surfaces] = []
    for foot, head in ((front, front - 0.55), (rear, rear + 0.3)):
        slant = np.arctan2(head - foot, rise)
        parts.append(
            boxes(
                [[0.5 * (foot + head), 0.0, 0.5 * (bonnet + height) - 0.02]],
                [[0.02, half - 0.15, 0.5 * np.hypot(rise, head - foot)]],
                SurfaceClass.CAR,
                rotations=exp_rotation(np.array([0.0, slant, 0.0])),
                loss=_GLASS,
            )
        )
    middle, half_length = 0.5 * (rear + front) - 0.05, 0.5 * (front - rear) - 0.45
    parts.append(
        boxes(
            [
                [middle, half - 0.125, bonnet + 0.5 * rise],
                [middle, 0.125 - half, bonnet + 0.5 * rise],
            ],
            [half_length, 0.01, 0.35 * rise],
            SurfaceClass.CAR,
            loss=_GLASS,
        )
    )
    return Surfaces.joined(parts)


def _wheels(length: float, half: float) -> Surfaces:
    x = np.array([0.31, 0.31, -0.30, -0.30]) * length
    side = np.array([1.0, -1.0, 1.0, -1.0])
    inner = np.column_stack([x, side * (half - 0.2), np.full(4, 0.31)])
    outer = np.column_stack([x, side * (half + 0.01), np.full(4, 0.31)])
    return cones(inner, outer, 0.31, 0.31, SurfaceClass.CAR, loss=0.2)


def person(rng: np.random.Generator) -> Surfaces:
    """Generate a walking pedestrian."""
    height = rng.uniform(1.55, 1.92)
    stride = rng.uniform(0.1, 0.3)
    hips = 0.5 * height
    legs = cones(
        [[stride, 0.09, 0.0], [-stride, -0.09, 0.0]], [[0.0, 0.08, hips], [0.0, -0.08, hips]],
        0.06, 0.09, SurfaceClass.PERSON,
    )  # fmt: skip
    torso = ellipsoids(
        [[0.0, 0.0, 0.67 * height], [0.0, 0.0, 0.93 * height]],
        [[0.14, 0.21, 0.2 * height], [0.1, 0.09, 0.07 * height]],
        SurfaceClass.PERSON,
    )
    shoulder = 0.8 * height
    arms = cones(
        [[0.0, 0.22, shoulder], [0.0, -0.22, shoulder]],
        [[-stride, 0.26, hips], [stride, -0.26, hips]],
        0.05, 0.04, SurfaceClass.PERSON,
    )  # fmt: skip
    return Surfaces.joined([legs, torso, arms])
