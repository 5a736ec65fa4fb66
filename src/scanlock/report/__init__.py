"""Static figures of registrations and segmentations; needs the extra ``figures``."""
