import numba
import pytest

from reference.samples import street
from scanlock.kernels.gaussians import d2d, p2d
from scanlock.kernels.ground import clusters, point_passes
from scanlock.kernels.points import moments, neighbourhood_sums, polar
from scanlock.kernels.search import bev_grid, cliques, compatibility, rotated_grids
from scanlock.kernels.verification import overlap, range_image, score_profile
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.segmentation.segmentation import segment

pytestmark = pytest.mark.slow

_KERNELS = (
    bev_grid.occupied_height_bins,
    cliques.greedy_cliques,
    clusters.occupied_cells,
    compatibility.free_compatibility,
    compatibility.level_compatibility,
    compatibility.soft_overlap,
    d2d.d2d_terms,
    moments.labelled_moments,
    neighbourhood_sums.sorted_by_voxel,
    neighbourhood_sums.sums_within_radius,
    overlap.overlap_masks_and_score,
    p2d.p2d_terms,
    point_passes.lowest_points,
    polar.polar_cells,
    range_image.build_range_image,
    range_image.free_space_violation,
    rotated_grids.rotated_grids,
    score_profile.scores_along_direction,
)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="there is no compiler to warm up")
def test_nothing_is_compiled_after_warm_up():
    warm_up()
    before = [tuple(kernel.signatures) for kernel in _KERNELS]
    scan = street(1)
    segment(scan.astype("float32"))
    for method in METHODS:
        register(source=scan, target=street(2), method=method)
    assert [tuple(kernel.signatures) for kernel in _KERNELS] == before
    assert all(before)
