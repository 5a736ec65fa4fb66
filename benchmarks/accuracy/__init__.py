"""Errors of poses and of ground segmentation, from near starts or without a start error.

``real_pairs`` and ``simulated_pairs`` register from the identity, ``split_scans`` registers two
halves of one scan, ``airborne`` two halves of a tile, ``settings`` changes one setting at a time,
and ``ground`` scores ground segmentation. Far starts and success rates belong to ``robustness``.
"""
