import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock import METHODS, Gicp, InvalidInput
from scanlock.optimisation.solvers import Newton
from scanlock.registration.settings.changes import changed_settings


def test_the_other_settings_keep_their_values():
    method = Gicp(voxel_size=0.7, neighbours=12)
    changed = changed_settings(method, ["solver.rotation_scale = 3", "neighbours=8"])
    assert (changed.voxel_size, changed.neighbours) == (0.7, 8)
    assert changed.solver.rotation_scale == 3.0
    assert type(changed.solver) is type(method.solver)
    assert changed_settings(method, []) == method


@given(st.floats(1e-3, 1e3))
def test_a_number_is_changed_with_every_digit(value):
    changed = changed_settings(METHODS["icp"], [f"voxel_size={value!r}"])
    assert changed.voxel_size == value


@pytest.mark.parametrize(
    ("method", "change", "path", "expected"),
    [
        ("icp", "voxel_size=none", "voxel_size", None),
        ("icp", "robust.loss=huber", "robust.loss", "huber"),
        ("icp", 'search="delaunay"', "search", "delaunay"),
        ("ndt", "cell_sizes=[8, 4.5]", "cell_sizes", (8.0, 4.5)),
        ("auto", "search.align_ground=false", "search.align_ground", False),
        ("auto", "fine=none", "fine", None),
        ("gicp", "solver=Newton", "solver", Newton()),
        ("sgc-ndt-d2d", "extractor.segmenter.ground.max_seed_range=inf",
         "extractor.segmenter.ground.max_seed_range", math.inf),
    ],
)  # fmt: skip
def test_values_have_the_type_of_the_setting(method, change, path, expected):
    value = changed_settings(METHODS[method], [change])
    for name in path.split("."):
        value = getattr(value, name)
    assert value == expected


def test_a_class_is_followed_by_its_settings():
    changed = changed_settings(METHODS["gicp"], ["solver=Newton", "solver.rotation_scale=3"])
    assert changed.solver == Newton(rotation_scale=3.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["voxelsize=1"], "voxelsize is not a setting of Icp, .*; did you mean voxel_size"),
        (["voxel_size=wide"], "voxel_size must be a number or \"none\", got 'wide'"),
        (["voxel_size=-1"], "voxel_size must be positive"),
        (["voxel_size"], "must be KEY=VALUE"),
        (["=1"], "must be KEY=VALUE"),
        (["robust..loss=huber"], "must be KEY=VALUE"),
        (["voxel_size=1", "voxel_size=2"], "voxel_size must be given once"),
        (["voxel_size=1\nneighbours=2"], "voxel_size must be a number"),
    ],
)
def test_invalid_changes_are_refused_by_name(changes, message):
    with pytest.raises(InvalidInput, match=message):
        changed_settings(METHODS["icp"], changes)
