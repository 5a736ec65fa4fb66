"""How firmly the parts of a scan hold a pose: poles and crowns are no planes, and hold it too."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.geometry.rotations import hat, hats
from scanlock.models.gaussians import Gaussians

MotionKind = Literal["translation", "rotation"]

PARTS: dict[MotionKind, slice] = {"translation": slice(0, 3), "rotation": slice(3, 6)}
"""Of a step ``(rho, phi)``."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusterConstraints:
    """What the thin sides of a scan's parts hold of a pose, about the zero of its frame.

    Attributes
    ----------
    information : (6, 6)
        Of a step ``(rho, phi)``, scaled so that the translation held best has 1.
    possible : (6, 6)
        What it would be if every part held all directions alike, and one in all.
    """

    information: Matrix
    max_information: Matrix

    def __post_init__(self) -> None:
        frozen(self.information)
        frozen(self.max_information)

    @classmethod
    def none(cls) -> "ClusterConstraints":
        """Return that of a scan without parts."""
        return cls(np.zeros((6, 6)), np.eye(6))

    def shares(self, kind: MotionKind, axes: Matrix, origin: Vector) -> Vector:
        """Return (k,) how firmly motions along or about the columns of (3, k) axes are held.

        In [0, 1], over what is possible; rotations are those about `origin` (3,) [m], when the
        translation may give way.
        """
        held, max_information = (
            _about(information, origin, kind)
            for information in (self.information, self.max_information)
        )
        most = np.maximum(along(max_information, axes), 1e-9)
        # Scaled by the translation held best, a rotation may be held better than by all parts.
        return np.clip(along(held, axes) / most, 0.0, 1.0)


def cluster_constraints(gaussians: Gaussians) -> ClusterConstraints:
    """Return how firmly the thin sides of parts hold a pose.

    A Gaussian holds a translation along its thin axes, not along its longest: that end is where
    a cluster was cut, or where the view ended, and slides along a corridor with the sensor.
    Each axis holds ``(1 - variance / largest variance)^4``, weighted by count: the power tells
    what is thin from what was cut narrower than long. Only round ones: each is an object of its
    own and holds all directions alike.
    """
    weights = gaussians.weights() ** 2
    every = np.broadcast_to(np.eye(3), (len(gaussians), 3, 3))
    max_information = _summed(gaussians.means, every, weights)
    # A matrix has the same axes as its square, so none of them need be found one by one.
    thin = every - gaussians.covariances / gaussians.max_variances[:, None, None]
    information = _summed(gaussians.means, np.linalg.matrix_power(thin, 4), weights)
    most = float(np.linalg.eigvalsh(information[:3, :3])[2])
    return ClusterConstraints(
        information / most if most > 0.0 else max_information, max_information
    )


def along(form: Matrix, axes: Matrix) -> Vector:
    """Return (k,) what a quadratic form (3, 3) is along each column of (3, k) axes."""
    return (axes * (form @ axes)).sum(axis=0)


def _summed(points: Points, held: NDArray[np.float64], weights: Vector) -> Matrix:
    """Return (6, 6) information of (k, 3, 3) what is held at each of (k, 3) places."""
    # Of each place, by a step.
    motions = np.concatenate([np.broadcast_to(np.eye(3), held.shape), -hats(points)], axis=2)
    resisted = (weights[:, None, None] * held) @ motions
    return motions.reshape(-1, 6).T @ resisted.reshape(-1, 6)


def _about(information: Matrix, origin: Vector, kind: MotionKind) -> Matrix:
    """Return the (3, 3) block of a kind of motion about another origin."""
    if kind == "translation":
        return information[:3, :3]
    moved = np.eye(6)
    moved[:3, 3:] = hat(origin)
    moved = moved.T @ information @ moved
    coupling = moved[3:, :3]
    return moved[3:, 3:] - coupling @ np.linalg.pinv(moved[:3, :3], hermitian=True) @ coupling.T
