"""Ground segmentation: the corrected Gaussian process in polar sectors, and the published form."""
