"""Settings are values, and every kernel has one compiled signature."""

import os
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import pytest

from contracts.traits import METRES, RADIANS, result, source, target
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD, METHODS

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("method", METHODS)]

_TESTS = Path(__file__).resolve().parents[1]
_PYTHONPATH = [path for path in [os.environ.get("PYTHONPATH")] if path]


def test_settings_compare_by_value_and_are_frozen(method):
    settings = METHODS[method]
    assert replace(settings) == settings
    assert hash(replace(settings)) == hash(settings)
    assert pickle.loads(pickle.dumps(settings)) == settings
    for field in fields(settings):
        with pytest.raises(FrozenInstanceError):
            setattr(settings, field.name, None)
    assert register(
        source=source(method), target=target(), method=replace(settings)
    ).target_from_source == (result(method).target_from_source)


def test_prepared_data_can_be_used_as_target_and_as_source(method):
    settings = METHODS[method]
    first, second = (
        settings.prepare(PointCloud.from_array(scan)) for scan in (target(), source(method))
    )
    forth = settings.align(first, second)
    assert forth.pose == result(method).target_from_source
    back = settings.align(second, first, Pose.identity())
    assert (forth.pose @ back.pose).is_close(
        Pose.identity(), translation=2 * METRES, rotation=2 * RADIANS
    )


def test_an_unknown_method_is_refused_with_the_known_names(method):
    assert DEFAULT_METHOD in METHODS
    with pytest.raises(InvalidInput, match=f"{method}.*, got 'icp-of-old'"):
        register(source=source(method), target=target(), method="icp-of-old")


_ALL_LAYOUTS = """
import importlib, pkgutil, sys
import numpy as np
import scanlock, scanlock.kernels
from reference.samples import street

single, double = street(1, 3000).astype(np.float32), street(2, 3000)
wide = np.column_stack([double, np.arange(3000.0)])
frozen = double.copy()
frozen.setflags(write=False)
tilted = double @ np.array([[0.9, 0.0, -0.19**0.5], [0.0, 1.0, 0.0], [0.19**0.5, 0.0, 0.9]])
bare = double[double[:, 2] > -1.0]
layouts = [single, np.asfortranarray(double), wide[::2], frozen, double.tolist(), wide[:, 1:],
           double.astype(">f8"), np.insert(double, 5, np.nan, axis=0), double + 1e6, tilted,
           bare, (100 * double).astype(np.int32)]
for layout in layouts:
    scanlock.segment(layout)
    scanlock.register(source=layout, target=double, method=sys.argv[1])
    scanlock.register(source=double, target=layout, method=sys.argv[1])
root = "scanlock.kernels."
for info in pkgutil.walk_packages(scanlock.kernels.__path__, root):
    module = importlib.import_module(info.name)
    for name, value in vars(module).items():
        if hasattr(value, "signatures"):
            print(f"{info.name.removeprefix(root)}.{name}", len(value.signatures))
"""


def test_every_kernel_has_one_compiled_signature(method):
    # In a separate process: other tests call kernels with further array layouts.
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _ALL_LAYOUTS, method],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(_TESTS), *_PYTHONPATH])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    signatures = dict(line.split() for line in done.stdout.splitlines())
    assert set(signatures.values()) <= {"0", "1"}
    used = {
        "points.polar.polar_cells",
        "points.neighbourhood_sums.sorted_by_voxel",
        "points.neighbourhood_sums.sums_within_radius",
        "ground.splitting.split_by_extent",
        "ground.clusters.occupied_cells",
        "ground.clusters.connected_components",
        "verification.overlap.overlap_masks_and_score",
    }
    if "p2d" in method:
        used |= {
            "gaussians.p2d.p2d_terms",
            "gaussians.p2d.bounding_balls",
            "points.morton.morton_codes",
        }
    elif "d2d" in method:
        used |= {"gaussians.d2d.d2d_terms"}
    assert {signatures[name] for name in used} == {"1"}
