"""Visits of a world: the structure depends on the seed, the loose things on the visit too."""

from dataclasses import dataclass

import numpy as np

from scanlock.errors import require_count, require_fraction

_STRUCTURE, _FIRST, _CHOICE, _AGAIN = 1, 2, 3, 4
"""Distinct streams of random numbers."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Visit:
    """One visit of one part of a world that repeats."""

    seed: int
    """Seed of the structure and of all loose things."""
    part: int = 0
    """Index of one of several equal parts, as the floors of a car park or the halls of a
    warehouse. Their structure is the same, their loose things are independent."""
    number: int = 0
    """Index of the visit; in the first, 0, nothing has changed yet."""
    changed: float = 0.0
    """Fraction of the places for loose things that are dealt anew since the first visit."""

    def __post_init__(self) -> None:
        for name in ("seed", "part", "number"):
            require_count(name, getattr(self, name), minimum=0)
        require_fraction("changed", self.changed)

    def structure_rng(self) -> np.random.Generator:
        """Return the source of random choices of the structure."""
        return np.random.default_rng([self.seed, _STRUCTURE])

    def place_rng(self, place: int) -> np.random.Generator:
        """Return the source of random choices of one place for a loose thing.

        Parameters
        ----------
        place : int
            Index of the place in the world.
        """
        if self.number > 0 and self.changed > 0.0:
            at = [self.seed, _CHOICE, self.part, place, self.number]
            if np.random.default_rng(at).random() < self.changed:
                return np.random.default_rng([self.seed, _AGAIN, self.part, place, self.number])
        return np.random.default_rng([self.seed, _FIRST, self.part, place])
