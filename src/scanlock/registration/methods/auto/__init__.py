"""The default method, from hypotheses to the choice of a pose.

- `auto`: `Auto`, the settings and the order of the steps.
- `data`: data of a prepared scan and of a pair.
- `multi_start`: `MultiStart`, D2D refinement of many hypotheses.
- `ranking`: scores of the refined poses, and their order.
- `similar_poses`: hypotheses one period or half a turn from a pose.
- `judgement`: choice among poses with similar scores, by the verification.

Searches belong to `scanlock.registration.search`, the verification of a pose to
`scanlock.registration.verification`.
"""
