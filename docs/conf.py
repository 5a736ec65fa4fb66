"""Sphinx settings."""

import os

# Undecorated kernels keep their signatures and docstrings, and nothing needs compiling.
os.environ["NUMBA_DISABLE_JIT"] = "1"

from numpy.typing import ArrayLike
from sphinx.util.typing import stringify_annotation

import scanlock
from scanlock import arrays

project = "scanlock"
author = "The scanlock developers"
copyright = author
release = version = scanlock.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build"]
default_role = "py:obj"

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {
    "members": True,
    "undoc-members": False,
    # A package that re-exports the names of its modules documents them there, once.
    "ignore-module-all": True,
}
# Fields are listed once, from their own docstrings or from the class's Attributes section.
napoleon_use_ivar = True
napoleon_google_docstring = False

html_theme = "furo"
html_title = f"scanlock {release}"

_ALIASES = {
    stringify_annotation(alias, "smart"): name
    for alias, name in [
        (arrays.Points, "NDArray[float64]"),
        (arrays.Labels, "NDArray[int64]"),
        (arrays.Mask, "NDArray[bool]"),
        (ArrayLike, "ArrayLike"),
    ]
}


def _name_array_types(_app, _what, _name, _object, _options, signature, returned):
    """Write the names of array types, which Python has expanded, into signatures again."""
    for expanded, name in _ALIASES.items():
        signature = signature and signature.replace(expanded, name)
        returned = returned and returned.replace(expanded, name)
    return signature, returned


def setup(app):
    """Connect the events of this file."""
    app.connect("autodoc-process-signature", _name_array_types)
