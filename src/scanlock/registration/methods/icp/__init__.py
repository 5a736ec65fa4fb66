"""ICP: the method and its parts.

- `icp`: `Icp` (Madhavan and Messina 2003).
- `annealing`: `AnnealedStart`, simulated annealing before ICP.
- `history`: convergence and cycles of ICP.
- `correspondences`: closest points and their weights; step 1 of the paper.
- `distance_rejection`: distance thresholds (Zhang 1994, Chetverikov et al. 2002, Madhavan and
  Messina 2003).
- `transform_estimation`: the pose of given correspondences; steps 2 and 3 of the paper.

Solvers belong to `scanlock.optimisation`; ICP of surfaces is `scanlock.registration.methods.gicp`.
"""
