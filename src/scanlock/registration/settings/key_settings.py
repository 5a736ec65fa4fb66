"""The settings of each method that are changed most often, as a short TOML file."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import Method
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.registry import named_method
from scanlock.registration.settings.text import setting_text

_SEGMENTER = (
    "extractor.segmenter.ground.height_threshold",
    "extractor.segmenter.ground.grid.max_range",
    "extractor.segmenter.clusters.min_points",
    "extractor.segmenter.clusters.grid.max_range",
    "extractor.segmenter.clusters.merge.max_distance",
)
_NEWTON = ("solver.criteria.step_tolerance", "solver.criteria.max_iterations")
_CELLS = ("grid.min_points", "grid.variance_ratio", "grid.min_deviation")

KEY_SETTINGS: Mapping[type, tuple[str, ...]] = {
    Auto: (
        "search.headings",
        "search.max_hypotheses",
        "search.projector.max_range",
        "search.projector.cell_size",
        "fallback_threshold",
        "initial_pose_preference",
        *(f"initial_method.{key}" for key in _SEGMENTER),
        "fine.cell_sizes",
    ),
    SgcNdt: (
        "score",
        "voxel_size",
        "merge_ratio",
        "extractor.min_deviation",
        *_SEGMENTER,
        "schedule.coarse_tolerance",
        *(f"schedule.{key}" for key in _NEWTON),
    ),
    Gicp: (
        "voxel_size",
        "search.max_correspondence_distances",
        "search.voxel_sizes",
        "neighbours",
        "shape",
        "max_surface_radius",
        "covariance_epsilon",
        "robust.loss",
        "robust.min_scale",
        "coarse_tolerance",
        "step_tolerance",
        "max_iterations",
        "solver",
    ),
    Icp: (
        "voxel_size",
        "max_correspondence_distance",
        "search",
        "rejection",
        "estimation.algorithm",
        "estimation.residual",
        "neighbours",
        "robust.loss",
        "criteria.step_tolerance",
        "criteria.max_iterations",
        "noise",
        "annealing",
    ),
    Ndt: (
        "cell_sizes",
        "voxel_size",
        "association",
        "outlier_ratio",
        *_CELLS,
        "coarse_tolerance",
        *_NEWTON,
    ),
    NdtD2d: (
        "cell_sizes",
        "association",
        "neighbour_cells",
        "weight_power",
        "shape.sharpness",
        *_CELLS,
        "coarse_tolerance",
        *_NEWTON,
    ),
    MskmNdt: (
        "score",
        "cluster_counts",
        "points",
        "voxel_size",
        "min_points",
        "min_deviation",
        "ground.height_threshold",
        "ground.grid.max_range",
        "k_means.seed",
        "coarse_tolerance",
        *_NEWTON,
    ),
}
"""Paths of at most twelve settings by the class of a method, most general first. Those of a class
that the method does not use, such as another search, are left out."""


def key_settings_to_toml(name: str) -> str:
    """Return the settings of a method that are changed most often, as TOML with comments.

    Parameters
    ----------
    name : str
        Key of `METHODS`. Of a class without a list, all plain settings are returned.

    Returns
    -------
    str
        A file for `read_settings`; all other settings keep their defaults.

    Raises
    ------
    InvalidInput
        An unknown name.
    """
    name, method = named_method(name)
    blocks = [setting_text(method, key) for key in key_settings(method)]
    return "".join([f'method = "{name}"\n', *blocks])


def key_settings(method: Method[Any]) -> list[str]:
    """Return the paths of the settings of a method that are changed most often."""
    keys = KEY_SETTINGS.get(type(method))
    if keys is None:
        fields = dataclasses.fields(method) if dataclasses.is_dataclass(method) else ()
        return [
            field.name
            for field in fields
            if not dataclasses.is_dataclass(getattr(method, field.name))
        ]
    return [key for key in keys if _has(method, key)]


def _has(settings: object, key: str) -> bool:
    for part in key.split("."):
        if not hasattr(settings, part):
            return False
        settings = getattr(settings, part)
    return True
