"""Folds of cross-validation: trials by scene, by kind of world, and by kind of sensor."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_FOLDS = 5
"""Number of folds of the simulated scenes of one kind of case, by seed."""

_SIMULATED = re.compile(r"(simulated|repeating) \w+ (\d+)")

Numbers = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Fold:
    """Trials that are evaluated with a model fitted to other trials."""

    name: str
    evaluated: Mask
    fitted: Mask


def by_scene(scenes: NDArray[np.str_]) -> list[Fold]:
    """Return one fold per real data set, and five of each kind of simulated scenes, by seed."""
    names: list[str] = []
    for scene in scenes:
        found = _SIMULATED.fullmatch(str(scene))
        names.append(f"{found[1]} {int(found[2]) % _FOLDS}" if found else str(scene))
    column = np.array(names)
    return [
        Fold(name=str(name), evaluated=column == name, fitted=column != name)
        for name in np.unique(column)
    ]


def by_name(column: NDArray[np.str_]) -> list[Fold]:
    """Return one fold per kind of world or sensor.

    Trials of two scans of different kinds have both names, joined by "and". They are a fold of
    their own, and no model is fitted to a trial that shares a name with those evaluated.
    """
    kinds = np.unique(column)
    names = {kind: set(str(kind).split(" and ")) for kind in kinds}
    return [
        Fold(
            name=str(kind),
            evaluated=column == kind,
            fitted=~np.isin(column, [other for other in kinds if names[other] & names[kind]]),
        )
        for kind in kinds
    ]


def single(folds: list[Fold]) -> Iterator[tuple[str, Mask]]:
    """Yield name and trials of the folds of one kind, then of all folds of two kinds together."""
    both = [fold for fold in folds if " and " in fold.name]
    for fold in folds:
        if " and " not in fold.name:
            yield fold.name, fold.evaluated
    if both:
        yield "two kinds", np.logical_or.reduce([fold.evaluated for fold in both])


def predicted(features: Numbers, folds: list[Fold], fit: Callable[[Mask], Numbers]) -> Numbers:
    """Return the probability of each trial by a model fitted without its fold.

    `fit` returns the intercept and the weights of a logistic model of the trials of a mask.
    """
    scores = np.empty(len(features))
    for fold in folds:
        weights = fit(fold.fitted)
        scores[fold.evaluated] = weights[0] + features[fold.evaluated] @ weights[1:]
    return 1.0 / (1.0 + np.exp(-scores))
