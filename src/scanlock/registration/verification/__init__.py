"""Verification of a pose: metrics, the probability that it is correct, and a status.

Verification needs two scans and a pose, whatever the method that found the pose. Its steps, in
order; `assessment` runs 2 to 5:

1. `features`: per scan, the cluster Gaussians, the range image and the query points.
2. `agreement`: the overlap and the score of the Gaussians (`overlap`), and the free-space
   violation (`range_image`), collected in a `candidate`.
3. `refinement`: a few point-to-plane steps on planes fitted around the query points
   (`local_planes`), each step from the normal equations of `plane_constraints`.
4. `observability`: the information along each direction, from the planes and from the clusters
   (`cluster_constraints`), and which directions are degenerate.
5. `metrics`: every number of the result, defined once.
6. `probability`: a logistic model of six of these numbers.
7. `decision`: the `status` and the sentence that explains it.

Covariances of a pose belong to `scanlock.registration.uncertainty`.
"""
