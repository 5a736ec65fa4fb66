"""Global search: pose hypotheses for two scans, without an initial pose.

`hypothesis`
    `Hypothesis`, the result of every search; selection of distinct poses.
`bev_grid`
    `BevProjector`: a levelled scan as occupied and free cells seen from above.
`bev_correlation`
    `BevSearch`: exhaustive search over heading and horizontal translation by FFT, with partial
    whitening (phase correlation: Kuglin and Hines 1975).
`ground_alignment`
    Height, roll and pitch of a hypothesis from the ground that both scans observed.
`cluster_features`
    `ClusterFeatures`: extents, axes and heights of clusters.
`cluster_matching`
    `ClusterMatcher`: hypotheses from cliques of consistent cluster matches, for scans without a
    ground or with any roll and pitch (proposed by Das et al. 2013; similar to G3Reg, Qiao et al.
    2023).

The refinement of hypotheses belongs to `scanlock.registration.methods.auto.multi_start`.
"""
