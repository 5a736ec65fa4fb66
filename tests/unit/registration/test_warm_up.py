import numba
import pytest

from reference.samples import street
from scanlock.kernels.gaussians import d2d, p2d
from scanlock.kernels.ground import clusters as grouping
from scanlock.kernels.ground import point_passes as ground
from scanlock.kernels.points import moments, polar
from scanlock.kernels.points import neighbourhood_sums as probing
from scanlock.kernels.search import bev_grid as plan_view
from scanlock.kernels.search import cliques as agreeing_sets
from scanlock.kernels.search import compatibility
from scanlock.kernels.search import rotated_grids as turned_maps
from scanlock.kernels.verification import overlap as meeting
from scanlock.kernels.verification import range_image
from scanlock.kernels.verification import score_profile as sliding
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.segmentation.segmentation import segment

_KERNELS = (
    agreeing_sets.grown_sets,
    compatibility.free_compatibility,
    compatibility.level_compatibility,
    compatibility.soft_overlap,
    ground.lowest_points,
    grouping.occupied_cells,
    meeting.overlap_masks_and_score,
    moments.labelled_moments,
    plan_view.column_slots,
    polar.polar_cells,
    probing.sorted_by_voxel,
    probing.sums_within_radius,
    range_image.free_space_violation,
    range_image.build_range_image,
    sliding.scores_along_direction,
    d2d.d2d_terms,
    p2d.p2d_terms,
    turned_maps.turned_maps,
)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="there is no compiler to warm up")
def test_after_it_real_work_compiles_nothing():
    warm_up()
    before = [tuple(kernel.signatures) for kernel in _KERNELS]
    scan = street(1)
    segment(scan.astype("float32"))
    for method in METHODS:
        register(source=scan, target=street(2), method=method)
    assert [tuple(kernel.signatures) for kernel in _KERNELS] == before
    assert all(before)
