"""Verification of a pose: metrics, the probability that it is correct, and a status.

Verification needs two scans and a pose, whatever the method that found the pose. Its steps, in
order; `assessment` runs 2 to 6:

1. `features`: per scan, the cluster Gaussians, the range image, the query points, the `low_objects`
   and the `self_similarity`.
2. `agreement`: the overlap and the score of the Gaussians (`overlap`), and the free-space
   violation (`range_image`), collected in a `candidate`.
3. `refinement`: a few point-to-plane steps on planes fitted around the query points
   (`local_planes`), each step from the normal equations of `plane_constraints`.
4. `observability`: the information along each direction, from the planes and from the clusters
   (`cluster_constraints`), and which directions are degenerate.
5. `object_odds`: the low objects that the other scan confirms or misses, at the pose and after the
   motions at which both scans correlate with themselves. They distinguish look-alikes of a place.
6. `metrics`: every number of the result, defined once.
7. `probability`: a logistic model of seven of these numbers.
8. `decision`: the `status` and the sentence that explains it.

Covariances of a pose belong to `scanlock.registration.uncertainty`.
"""
