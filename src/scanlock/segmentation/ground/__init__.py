"""Ground segmentation: the corrected Gaussian process in polar sectors, and the published form.

Everything above the ground belongs to `scanlock.segmentation.clusters`, and the loops over points
to `scanlock.kernels.ground`.
"""
