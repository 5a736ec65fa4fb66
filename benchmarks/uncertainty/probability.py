"""Fit and cross-validation of the probability that a pose is correct.

    python -m benchmarks.uncertainty.failure_trials trials.npz
    python -m benchmarks.uncertainty.probability trials.npz [more.npz ...] [--fit]
        [--figure reliability.png] [--each] [--left-out world]

Prints failure detection by the model in scanlock, and by the same model fitted without the scene
that it is evaluated on (all real scans of one folder, or every fifth simulated scene), without the
kind of world, and without the kind of sensor. ``--fit`` prints the constants of
`scanlock/registration/verification/probability.py`; ``--each`` and ``--figure`` show the poses by
the model without what ``--left-out`` names.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import rankdata

from benchmarks._common.arguments import make_parser
from benchmarks._common.folds import (
    Fold,
    Mask,
    Numbers,
    by_name,
    by_scene,
    predicted,
    single,
)
from benchmarks._common.results import Results
from scanlock.registration.registry import METHODS
from scanlock.registration.verification import probability as model
from scanlock.registration.verification.decision import MIN_PROBABILITY

_SIGNS = (-1, -1, -1, -1, 1, -1, 1)
"""Required signs of the weights."""

_REPEATING_IMPORTANCE = 0.2
"""Weight of a trial of a world that repeats in the fit, relative to all others. These worlds are
exact copies of themselves, more than half of their poses are wrong, and they are rare."""

_SHRINKAGE = 1e-3
"""Weight of the squared standardised weights in the loss."""

_COLUMNS_LEFT_OUT = ("scene", "world", "sensor")

_BINS = (0.0, 0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0)
"""Edges of the probability bins."""


def read(paths: list[Path]) -> dict[str, Any]:
    """Return the concatenated columns of several files of trials."""
    files = [np.load(path) for path in paths]
    return {name: np.concatenate([one[name] for one in files]) for name in files[0].files}


def fitted(features: Numbers, right: Mask, importance: Numbers) -> Numbers:
    """Return intercept and weights of the regularised logistic regression."""
    importance = importance / importance.sum()
    mean, deviation = features.mean(axis=0), features.std(axis=0)
    rows = np.column_stack([np.ones(len(features)), (features - mean) / deviation])
    signs = np.where(right, 1.0, -1.0)
    penalty = np.array([0.0] + [_SHRINKAGE] * features.shape[1])

    def loss(weights: Numbers) -> tuple[float, Numbers]:
        margins = signs * (rows @ weights)
        slopes = -signs / (1.0 + np.exp(margins)) * importance
        value = importance @ np.logaddexp(0.0, -margins) + penalty @ weights**2
        return float(value), rows.T @ slopes + 2.0 * penalty * weights

    bounds = [(None, None)]
    bounds += [(0.0 if sign > 0 else None, 0.0 if sign < 0 else None) for sign in _SIGNS]
    start = np.zeros(rows.shape[1])
    standard = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
    weights = standard[1:] / deviation
    return np.concatenate([[standard[0] - weights @ mean], weights])


def fitted_to(own: dict[str, Any], at: Mask) -> Numbers:
    """Return intercept and weights of the model of some trials."""
    is_repeating = np.char.startswith(own["scene"][at].astype(str), "repeating")
    importance = np.where(is_repeating, _REPEATING_IMPORTANCE, 1.0)
    return fitted(own["features"][at], own["right"][at], importance)


def area_under_curve(scores: Numbers, right: Mask) -> float:
    """Return the area under the ROC curve."""
    ranks = rankdata(scores)
    positive = int(right.sum())
    above = ranks[right].sum() - positive * (positive + 1) / 2
    return float(above / (positive * (len(right) - positive)))


def row(name: str, scores: Numbers, right: Mask, ok: Mask) -> list[str]:
    """Return the cells of `COLUMNS`."""
    wrong = ~right
    return [
        name,
        f"{right.sum()} correct, {wrong.sum()} wrong",
        f"{area_under_curve(scores, right):.4f}" if right.any() and wrong.any() else "-",
        f"{(ok & wrong).sum()} ({1e3 * (ok & wrong).sum() / max(1, wrong.sum()):.1f} in 1000)",
        f"{(right & ~ok).sum()} ({100 * (right & ~ok).mean() / max(1e-9, right.mean()):.1f} %)",
    ]


COLUMNS = ("trials", "poses", "area under the ROC curve", "wrong, called ok", "correct, refused")


_WORST = "highest probability of a wrong pose called ok"


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Probabilities by models fitted without a scene, a kind of world or a kind of sensor."""

    name: str
    folds: list[Fold]
    held_out: Numbers
    right: Mask
    ok: Mask

    @classmethod
    def of(cls, name: str, own: dict[str, Any]) -> "LeftOut":
        """Return the probabilities of trials without what `name`, a column, distinguishes."""
        folds = by_scene(own[name]) if name == "scene" else by_name(own[name])
        held_out = predicted(own["features"], folds, lambda at: fitted_to(own, at))
        ok = (held_out >= MIN_PROBABILITY) & ~own["vetoed"]
        return cls(name=name, folds=folds, held_out=held_out, right=own["right"], ok=ok)

    def row(self, name: str, at: Mask) -> list[str]:
        """Return the cells of `COLUMNS` of some trials."""
        return row(name, self.held_out[at], self.right[at], self.ok[at])

    def with_worst(self, name: str, at: Mask) -> list[str]:
        """Return the cells of `COLUMNS` and the highest probability of a wrong pose called ok."""
        missed = self.held_out[at & self.ok & ~self.right]
        return [*self.row(name, at), f"{missed.max():.3f}" if len(missed) else "-"]


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("trials", type=Path, nargs="+")
    parser.add_argument("--fit", action="store_true", help="print the constants of the model")
    parser.add_argument("--figure", type=Path, help="write a reliability diagram")
    parser.add_argument("--each", action="store_true", help="print every wrong pose with status ok")
    parser.add_argument("--left-out", choices=_COLUMNS_LEFT_OUT, default="scene")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    trials = read(arguments.trials)
    is_own = np.isin(trials["method"], list(METHODS))
    own = {name: column[is_own] for name, column in trials.items()}
    if arguments.fit:
        weights = fitted_to(own, np.ones(len(own["right"]), np.bool_))
        print(f"INTERCEPT = {weights[0]:.2f}")
        print(f"WEIGHTS = ({', '.join(f'{weight:.2f}' for weight in weights[1:])})")
    print(f"{len(own['right'])} trials; {results.machine_line}\n")
    left_out = {name: LeftOut.of(name, own) for name in _COLUMNS_LEFT_OUT}
    rows = [*scene_rows(left_out["scene"], own), *peer_rows(trials, ~is_own)]
    results.add_table(COLUMNS, rows, title="failure detection")
    for name in ("world", "sensor"):
        rows = kind_rows(left_out[name], own)
        results.add_table((*COLUMNS, _WORST), rows, title=f"by {name}, left out of the fit")
    for name, one in left_out.items():
        results.add_table(
            ("probability", "trials", "mean probability", "correct"),
            reliability(one.held_out, one.right),
            title="reliability" if name == "scene" else f"reliability, {name} left out",
        )
    chosen = left_out[arguments.left_out]
    if arguments.each:
        print_each(chosen, own)
    if arguments.figure is not None:
        draw(arguments.figure, chosen.held_out, chosen.right)


def scene_rows(one: LeftOut, own: dict[str, Any]) -> list[list[str]]:
    """Return the rows of all trials, and of each kind, method and scene."""
    features, right = own["features"], own["right"]
    current = 1.0 / (1.0 + np.exp(-(model.INTERCEPT + features @ np.array(model.WEIGHTS))))
    everything = np.ones(len(right), np.bool_)
    ok = (current >= MIN_PROBABILITY) & ~own["vetoed"]
    rows = [
        one.row("all, scene left out of the fit", everything),
        row("all, as in scanlock", current, right, ok),
    ]
    for name in ("kind", "method"):
        for value in np.unique(own[name]):
            rows.append(one.row(f"{value}, scene left out", own[name] == value))
    return rows + [one.row(f"{fold.name}, left out", fold.evaluated) for fold in one.folds]


def kind_rows(one: LeftOut, own: dict[str, Any]) -> list[list[str]]:
    """Return the rows of all trials, of each kind of world or sensor, and of each kind of case."""
    rows = [one.with_worst("all", np.ones(len(one.right), np.bool_))]
    rows += [one.with_worst(name, at) for name, at in single(one.folds)]
    for value in np.unique(own["kind"]):
        rows.append(one.with_worst(f"case: {value}", own["kind"] == value))
    return rows


def peer_rows(trials: dict[str, Any], is_peer: Mask) -> list[list[str]]:
    """Return one row per other library."""
    rows: list[list[str]] = []
    for name in np.unique(trials["method"][is_peer]):
        at = trials["method"] == name
        claimed = trials["status"][at] == "ok"
        rows.append(row(name, trials["score"][at], trials["right"][at], claimed))
    return rows


def print_each(one: LeftOut, own: dict[str, Any]) -> None:
    """Print every wrong pose that is called ok."""
    for index in np.flatnonzero(one.ok & ~one.right):
        names = ("scene", "world", "sensor", "kind", "method")
        print([str(own[name][index]) for name in names], end=" ")
        print(f"{own['metres'][index]:.2f} m {own['degrees'][index]:.2f} deg", end=" ")
        print(f"{one.held_out[index]:.3f}", np.round(own["features"][index], 2).tolist())


def reliability(predicted: Numbers, right: Mask) -> list[list[str]]:
    """Return mean probability and ratio of correct poses by bins of the probability."""
    bins = np.digitize(predicted, _BINS[1:-1])
    return [
        [
            f"{_BINS[one]:g} to {_BINS[one + 1]:g}",
            str((bins == one).sum()),
            f"{predicted[bins == one].mean():.4f}",
            f"{right[bins == one].mean():.4f}",
        ]
        for one in np.unique(bins)
    ]


def draw(path: Path, predicted: Numbers, right: Mask) -> None:
    """Write the reliability diagram."""
    from scanlock.report.canvas import save_figure
    from scanlock.report.reliability_figure import reliability_figure

    save_figure(path, reliability_figure(predicted, right, _BINS))


if __name__ == "__main__":
    main()
