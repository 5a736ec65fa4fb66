"""Static figures and tables of results; figures need the extra ``figures``."""
