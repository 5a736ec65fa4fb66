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

_KERNELS = (
    cliques.grown_sets,
    compatibility.free_compatibility,
    compatibility.level_compatibility,
    compatibility.soft_overlap,
    point_passes.lowest_points,
    clusters.occupied_cells,
    overlap.overlap_masks_and_score,
    moments.labelled_moments,
    bev_grid.column_slots,
    polar.polar_cells,
    neighbourhood_sums.sorted_by_voxel,
    neighbourhood_sums.sums_within_radius,
    range_image.free_space_violation,
    range_image.build_range_image,
    score_profile.scores_along_direction,
    d2d.d2d_terms,
    p2d.p2d_terms,
    rotated_grids.turned_maps,
)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_nothing_is_compiled_after_the_warm_up():
    warm_up()
    before = [tuple(kernel.signatures) for kernel in _KERNELS]
    scan = street(1)
    segment(scan.astype("float32"))
    for method in METHODS:
        register(source=scan, target=street(2), method=method)
    assert [tuple(kernel.signatures) for kernel in _KERNELS] == before
    assert all(before)
