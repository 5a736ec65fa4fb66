"""Fit the probability that a pose is right, and show how far it can be trusted.

    python benchmarks/failure_trials.py trials.npz
    python benchmarks/confidence.py trials.npz [more.npz ...] [--fit] [--picture reliability.png]

Prints how well failures are told: by the model as it is in scanlock, and by the same model fitted
without the scenes it is asked about (all real scans of one folder, or every fifth of the simulated
scenes). `--fit` also prints the numbers to put into
`scanlock/registration/verification/probability.py`.
"""

import argparse
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import rankdata

from scanlock.registration.registry import METHODS
from scanlock.registration.verification import probability as confidence
from scanlock.registration.verification.decision import MIN_PROBABILITY
from tables import machine, print_table

_FOLDS = 5
"""Of the simulated scenes, by the number of their seed."""

_SIGNS = (-1, -1, -1, -1, 1, -1)
"""What speaks for a pose must not count against it."""

_SHRINKAGE = 1e-3
"""Weight of the squares of the standardised weights in the fit."""

_BINS = (0.0, 0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0)
"""Of probabilities, for the table and the picture of reliability."""

Numbers = NDArray[np.float64]


def read(paths: list[Path]) -> dict[str, Any]:
    parts = [np.load(path) for path in paths]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0].files}


def folds_of(scenes: NDArray[np.str_]) -> NDArray[np.str_]:
    """Return what is left out together with a trial of each scene."""
    found: list[str] = []
    for scene in scenes:
        seed = re.fullmatch(r"simulated \w+ (\d+)", scene)
        found.append(str(scene) if seed is None else f"simulated {int(seed[1]) % _FOLDS}")
    return np.array(found)


def fitted(features: Numbers, right: NDArray[np.bool_]) -> Numbers:
    """Return the intercept and weights of greatest likelihood, slightly shrunk."""
    mean, spread = features.mean(axis=0), features.std(axis=0)
    rows = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    signs = np.where(right, 1.0, -1.0)
    penalty = np.array([0.0] + [_SHRINKAGE] * features.shape[1])

    def loss(weights: Numbers) -> tuple[float, Numbers]:
        margins = signs * (rows @ weights)
        slopes = -signs / (1.0 + np.exp(margins))
        value = np.logaddexp(0.0, -margins).mean() + penalty @ weights**2
        return float(value), rows.T @ slopes / len(rows) + 2.0 * penalty * weights

    bounds = [(None, None)]
    bounds += [(0.0 if sign > 0 else None, 0.0 if sign < 0 else None) for sign in _SIGNS]
    start = np.zeros(rows.shape[1])
    standard = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
    weights = standard[1:] / spread
    return np.concatenate([[standard[0] - weights @ mean], weights])


def area_under_curve(scores: Numbers, right: NDArray[np.bool_]) -> float:
    """Return the chance that a right pose scores above a wrong one."""
    ranks = rankdata(scores)
    positive = int(right.sum())
    above = ranks[right].sum() - positive * (positive + 1) / 2
    return float(above / (positive * (len(right) - positive)))


def row(name: str, scores: Numbers, right: NDArray[np.bool_], ok: NDArray[np.bool_]) -> list[str]:
    wrong = ~right
    return [
        name,
        f"{right.sum()} right, {wrong.sum()} wrong",
        f"{area_under_curve(scores, right):.4f}" if right.any() and wrong.any() else "-",
        f"{(ok & wrong).sum()} ({1e3 * (ok & wrong).sum() / max(1, wrong.sum()):.1f} in 1000)",
        f"{(right & ~ok).sum()} ({100 * (right & ~ok).mean() / max(1e-9, right.mean()):.1f} %)",
    ]


HEADER = ("trials", "poses", "area under the ROC curve", "wrong called ok", "right refused")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trials", type=Path, nargs="+")
    parser.add_argument("--fit", action="store_true", help="print the numbers of the model")
    parser.add_argument("--picture", type=Path, help="where to draw the reliability")
    parser.add_argument("--each", action="store_true", help="print every wrong pose called ok")
    arguments = parser.parse_args()
    trials = read(arguments.trials)
    ours = np.isin(trials["method"], list(METHODS))
    kept = {name: column[ours] for name, column in trials.items()}
    right, features = kept["right"], kept["features"]
    folds = folds_of(kept["scene"])
    left_out = np.empty(len(right))
    for fold in np.unique(folds):
        weights = fitted(features[folds != fold], right[folds != fold])
        left_out[folds == fold] = weights[0] + features[folds == fold] @ weights[1:]
    held_out = 1.0 / (1.0 + np.exp(-left_out))
    current = 1.0 / (
        1.0 + np.exp(-(confidence.INTERCEPT + features @ np.array(confidence.WEIGHTS)))
    )
    if arguments.fit:
        weights = fitted(features, right)
        print(f"INTERCEPT = {weights[0]:.2f}")
        print(f"WEIGHTS = ({', '.join(f'{weight:.2f}' for weight in weights[1:])})")
    # Does not depend on the probability.
    refused = kept["barred"]
    print(f"{len(right)} trials; {machine()}\n")
    held_ok = (held_out >= MIN_PROBABILITY) & ~refused
    ok = (current >= MIN_PROBABILITY) & ~refused
    rows = [
        row("all, scene left out of the fit", held_out, right, held_ok),
        row("all, as in scanlock", current, right, ok),
    ]
    for name in ("kind", "method"):
        for value in np.unique(kept[name]):
            at = kept[name] == value
            rows.append(row(f"{value}, scene left out", held_out[at], right[at], held_ok[at]))
    for fold in np.unique(folds):
        at = folds == fold
        rows.append(row(f"{fold}, left out", held_out[at], right[at], held_ok[at]))
    for name in np.unique(trials["method"][~ours]):
        at = trials["method"] == name
        claimed = trials["status"][at] == "ok"
        rows.append(row(name, trials["score"][at], trials["right"][at], claimed))
    print_table(HEADER, rows)
    print()
    print_table(("probability", "trials", "said", "right"), reliability(held_out, right))
    if arguments.each:
        for index in np.flatnonzero(held_ok & ~right):
            print([str(kept[name][index]) for name in ("scene", "kind", "method")], end=" ")
            print(f"{kept['metres'][index]:.2f} m {kept['degrees'][index]:.2f} deg", end=" ")
            print(f"{held_out[index]:.3f}", np.round(features[index], 2).tolist())
    if arguments.picture is not None:
        draw(arguments.picture, held_out, right)


def reliability(said: Numbers, right: NDArray[np.bool_]) -> list[list[str]]:
    bins = np.digitize(said, _BINS[1:-1])
    return [
        [
            f"{_BINS[one]:g} to {_BINS[one + 1]:g}",
            str((bins == one).sum()),
            f"{said[bins == one].mean():.4f}",
            f"{right[bins == one].mean():.4f}",
        ]
        for one in np.unique(bins)
    ]


def draw(path: Path, said: Numbers, right: NDArray[np.bool_]) -> None:
    from scanlock.report.canvas import save_figure
    from scanlock.report.reliability_figure import reliability_figure

    save_figure(path, reliability_figure(said, right, _BINS))


if __name__ == "__main__":
    main()
