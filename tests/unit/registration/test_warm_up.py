import numba
import pytest

from reference.samples import street
from scanlock.kernels import ground, grouping, meeting, moments, polar, terms
from scanlock.models.segmentation import segment
from scanlock.registration.methods import METHODS
from scanlock.registration.register import register
from scanlock.registration.warm_up import warm_up

_KERNELS = (
    ground.lowest_in_cells,
    grouping.occupied_cells,
    meeting.meeting_gaussians,
    moments.labelled_moments,
    polar.polar_cells,
    terms.d2d_terms,
    terms.p2d_terms,
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
