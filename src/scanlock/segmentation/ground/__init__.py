"""Ground segmentation: the paper's Gaussian process in polar sectors and the corrected form."""
