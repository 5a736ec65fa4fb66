"""Agreement with evo 1.38.1, to the digits that rotations and rounding leave.

The trajectories of `reference.wavy_drives` were written by `write_tum_poses`, and the numbers
printed by ``evo_ape tum truth.tum est.tum -r REL OPTIONS --save_results r.zip`` and by ``evo_rpe``
with the same arguments; `stats.json` in the archive has all digits. REL is trans_part or
angle_deg.
"""

from dataclasses import astuple

import numpy as np
import pytest

from reference.wavy_drives import drifting, wavy_drive
from scanlock.evaluation.error_summary import Statistics
from scanlock.evaluation.trajectory_errors import absolute_errors, relative_errors

TIMES, TRUTH = wavy_drive()
ESTIMATE = drifting(TRUTH)

# rmse, mean, median, std, min, max of evo_ape.
_ABSOLUTE = {
    # no option
    "none": (
        "37.00699387948481 32.0318101251847 28.63529110411041 "
        "18.53323328780873 4.259802230875296 64.63782381396472",
        "41.99345093793012 41.99333466197755 41.99711223282617 "
        "0.09882127047823598 41.81531279515586 42.18391162800978",
    ),
    # --align_origin
    "first": (
        "1.1695686830589398 1.0313580178206636 0.9658032380200481 "
        "0.5515356230283361 0.0 1.9731078450689532",
        "0.2870894412553789 0.264195089449079 0.2619606724395086 "
        "0.11234456814336324 0.0 0.459186054042454",
    ),
    # -a
    "all": (
        "0.5639187963170719 0.5056871634306485 0.4751898753895146 "
        "0.2495694323853782 0.15295183409595595 1.00744114984351",
        "0.18354232074318036 0.17518951211780595 0.18286439641189683 "
        "0.05473955012344931 0.03206730370235881 0.2579009794706132",
    ),
    # -a -s
    "all+scale": (
        "0.017728591671692204 0.0169449651329626 0.016851999983527044 "
        "0.005212592378488473 0.0020924700595718313 0.029913749502790615",
        "0.18354232074318036 0.17518951211780595 0.18286439641189683 "
        "0.05473955012344931 0.03206730370235881 0.2579009794706132",
    ),
}

# The same of evo_rpe.
_RELATIVE = {
    # -d 1 -u f
    (1, "scans", False): (
        "0.02668204462342233 0.024329921270229694 0.021485825112127755 "
        "0.01095383203590072 0.0045307200501315875 0.04703263467496147",
        "0.10895583305085806 0.10509471073742988 0.1088346492567268 "
        "0.02874848397433157 0.0064563512164125675 0.15314123755967912",
    ),
    # -d 10 -u f
    (10, "scans", False): (
        "0.18783298579808216 0.1829196754580855 0.17788046478769262 "
        "0.0426804742725665 0.12476214549745462 0.24889384865817663",
        "0.3257039475536914 0.305849159166191 0.32747596953597036 "
        "0.11197925383476932 0.08697907279613568 0.45906064465509444",
    ),
    # -d 10 -u f --all_pairs
    (10, "scans", True): (
        "0.18614224095390924 0.1815214205567672 0.17677938289994455 "
        "0.04121780860740256 0.11929497548909936 0.24889384865817663",
        "0.33845995175135496 0.3242347465187704 0.3345158456589288 "
        "0.09709257484194246 0.06654905051938542 0.47275452079195146",
    ),
    # -d 10 -u m --pairs_from_reference
    (10, "m", False): (
        "0.21468265362781697 0.2143063175846797 0.21395613417560272 "
        "0.012706062016834819 0.19775997989813038 0.2417337505842031",
        "0.26520504181180443 0.24218734135104686 0.25577639476283165 "
        "0.10806944939117814 0.07744285602416977 0.3946643373280804",
    ),
    # -d 10 -u m --pairs_from_reference --all_pairs
    (10, "m", True): (
        "0.201591917518975 0.20091739599675984 0.20459498527704323 "
        "0.016477293311051504 0.16161195783853027 0.2375268990790902",
        "0.26947673289988455 0.2424483104240346 0.21754433934567963 "
        "0.11762876496387545 0.033690164319269196 0.4596675841588082",
    ),
}


def _assert_equal(errors, expected):
    found = [astuple(Statistics.of(errors.translations))]
    found.append(astuple(Statistics.of(np.degrees(errors.rotations))))
    expected = [np.array(text.split(), np.float64) for text in expected]
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-11, atol=1e-13)
    # The angle of a rotation near the identity is exact to about 1e-8 rad only.
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("alignment", _ABSOLUTE)
def test_absolute_errors_are_those_of_evo_ape(alignment):
    _assert_equal(absolute_errors(ESTIMATE, TRUTH, alignment), _ABSOLUTE[alignment])


@pytest.mark.parametrize(("delta", "unit", "all_pairs"), _RELATIVE)
def test_relative_errors_are_those_of_evo_rpe(delta, unit, all_pairs):
    found = relative_errors(ESTIMATE, TRUTH, delta, unit, all_pairs=all_pairs)
    _assert_equal(found, _RELATIVE[delta, unit, all_pairs])
