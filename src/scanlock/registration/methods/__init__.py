"""Registration methods: settings with `prepare` and `align`.

The contract
    `protocol`: `Method`, `PreparationLog` and `InsufficientData`.
The default method
    - `auto`: `Auto`, from hypotheses to the choice of a pose.
    - `auto_data`: data of a prepared scan and of a pair.
    - `multi_start`: `MultiStart`, D2D refinement of many hypotheses.
    - `fine_ndt`: `FineNdt`, D2D over small cells of whole scans.
    - `sparse_refinement`: `SparseRefinement`, planes around the points of sparse clouds.
NDT over clusters
    - `sgc_ndt`: `SgcNdt` (Das, Servos and Waslander 2013) and its D2D variant.
    - `coarse_to_fine`: `CoarseToFine`, the schedule of smoothing.
NDT over cells
    - `ndt`: `Ndt`, point to distribution (Biber and Strasser 2003, Magnusson 2009).
    - `ndt_d2d`: `NdtD2d`, distribution to distribution (Stoyanov et al. 2012).
    - `mskm_ndt`: `MskmNdt`, multi-scale k-means (Das and Waslander 2012).
    - `voxel_scan`: preparation of a scan as voxel Gaussians.
    - `gaussian_scan`: Gaussians of a scan at several scales, and the scales dense enough to use.
ICP
    `icp`: `Icp` (Madhavan and Messina 2003), its correspondences, thresholds and estimation.
Generalised ICP
    `gicp`: `Gicp` (Segal, Haehnel and Thrun 2009); by voxels (Koide et al. 2021).

Global searches belong to `scanlock.registration.search`, objectives and solvers to
`scanlock.optimisation`, and the test of the final pose to `scanlock.registration.verification`.
"""
