from scanlock.kernels.ground import model, point_passes
from scanlock.kernels.ground.dominant_planes import scored_triples
from scanlock.kernels.ground.envelope import lower_envelope
from scanlock.kernels.ground.model import blended_patch_heights
from scanlock.kernels.ground.patches import grow_patches
from scanlock.kernels.ground.plane import (
    best_sampled_plane,
    refined_plane,
    weighted_columns,
)


def test_every_kernel_has_one_compiled_signature():
    for kernel in (
        point_passes.lowest_points, point_passes.gather_prototypes, point_passes.sharp_prototypes,
        point_passes.classify_points, point_passes.rotated_points,
        lower_envelope, grow_patches, blended_patch_heights, best_sampled_plane, refined_plane,
        weighted_columns, scored_triples, model.prototype_patches,
        model.patch_members, model.select_seeds,
        model.knots_between_prototypes, model.extent,
    ):  # fmt: skip
        assert len(getattr(kernel, "signatures", ())) <= 1, kernel
