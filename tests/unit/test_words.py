"""Words that the field does not use stay out of the code, the pages and the names of tests.

docs/glossary.md has the words in use. Words that are right in one place and wrong in another, such
as share, part or gap, are not listed.
"""

import ast
import re
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]

_WORDS = {
    # Nouns of the first drafts.
    "footings?": "plane constraints",
    "hold[ _-]weak": "fix_degenerate",
    "part[ _-]hold": "cluster constraints",
    "weak directions?": "degenerate direction",
    "settling": "refinement",
    "evidence": "features, or support",
    "(?:meets?|meeting)": "correspond, overlap or hit",
    "pairings?": "correspondences",
    "gates?": "threshold, or maximum distance",
    "landmarks?": "cluster Gaussians",
    "heading[ _-]search": "BEV correlation",
    "plan[ _-]views?": "BEV grid",
    "openness": "free-cell weight",
    "turned[ _-]maps?": "rotated grids",
    "second[ _]best": "runner-up, or second-best with a hyphen",
    "rivals?": "runner-up",
    "loyalty": "initial-pose preference",
    "shortages?": "insufficient reason",
    "restraints?": "constraints",
    "(?<!linear )probing": "local plane fits",
    "probes?": "query points",
    "thinness": "covariance epsilon, or relative information",
    "flooring": "regularisation",
    "levers?(?![ _]arms?)": "rotation scale",
    "trails?": "history",
    "descents": "refinements of hypotheses",
    "blur": "smoothing",
    "partners?": "correspondence",
    "strays?": "outlier",
    "verdicts?": "assessment, or status",
    "doubt(?:s|ed|ful)?": "unverified, or covariance",
    # Verbs of people.
    "foretells?|foretold": "predict",
    "heed(?:s|ed)?": "use",
    "loosened": "coarse tolerance",
    "thinned": "downsampled",
    "mended": "corrected",
    "told": "estimated, or reported",
    "looked[ _]through": "in the free space of",
    "com(?:es?|ing)[ _]to[ _](?:\\w+[ _])?rest": "converge, or refine",
    "stands?[ _]where": "is at",
    "leans?[ _]on": "depend on",
    "gives?[ _]way": "change",
    # Turns of phrase.
    "(?<!look[-_ ])alike": "similar, or equal",
    "for[ _]want[ _]of": "without",
    "in[ _]vain": "without success",
    "lonely": "isolated",
    "nobody": "no one; name the caller",
    "of one's own": "custom",
    "on[ _]the[ _]way": "during",
    "so[ _]many": "the number",
    "thereby": "by this",
    "whom": "which",
    "worth[ _]the[ _]name": "a number",
}
"""Pattern of each retired word, and what to write instead. Letters continue a word, `_` ends it."""

_CODE_WORDS = _WORDS | {
    "(?<![a-zA-Z]_)least_(?!squares)\\w+": "min_...",
    "(?<![a-zA-Z]_)most_\\w+": "max_...",
}
_PAGE_WORDS = _WORDS | {
    "says? so": "report it",
    "toss-up": "ambiguous",
}
_TEST_NAME_WORDS = _WORDS | {
    "(?:who|whose)": "which",
    "what_(?:is|was|has)": "the noun",
}

_EXCEPTIONS: dict[tuple[str, str], str] = {}
"""Reason for each word that is right in one file: (file, matched text in lower case)."""

_PAGES_LEFT_OUT = {"docs/notes/benchmarks-raw.md", "docs/changelog.md"}
"""Pages of raw records; the changelog includes CHANGELOG.md, which quotes old names."""


def _retired(words, file, line, text):
    """Yield a message for each retired word in a line of text."""
    for word, replacement in words.items():
        for found in re.finditer(f"(?<![a-zA-Z])(?:{word})(?![a-zA-Z])", text, re.IGNORECASE):
            if (file, found[0].lower()) not in _EXCEPTIONS:
                yield f"{file}:{line}: {found[0]!r}; write: {replacement}"


def _retired_in_files(words, paths):
    any_word = re.compile(f"(?<![a-zA-Z])(?:{'|'.join(words)})(?![a-zA-Z])", re.IGNORECASE)
    messages = []
    for path in sorted(paths):
        file = path.relative_to(_ROOT).as_posix()
        for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if any_word.search(text):
                messages += _retired(words, file, line, text)
    return messages


@pytest.mark.slow
def test_code_has_no_retired_words():
    folders = _ROOT / "src", _ROOT / "benchmarks"
    endings = {".py", ".pyi"}
    paths = [path for folder in folders for path in folder.rglob("*") if path.suffix in endings]
    assert len(paths) > 200
    found = _retired_in_files(_CODE_WORDS, paths)
    assert not found, "\n".join(found)


def test_pages_have_no_retired_words():
    pages = [*(_ROOT / "docs").rglob("*.md"), _ROOT / "README.md", _ROOT / "CONTRIBUTING.md"]
    pages = [page for page in pages if page.relative_to(_ROOT).as_posix() not in _PAGES_LEFT_OUT]
    assert len(pages) > 20
    found = _retired_in_files(_PAGE_WORDS, pages)
    assert not found, "\n".join(found)


@pytest.mark.slow
def test_names_of_tests_have_no_retired_words():
    found = []
    for path in sorted((_ROOT / "tests").rglob("*.py")):
        file = path.relative_to(_ROOT).as_posix()
        found += _retired(_TEST_NAME_WORDS, file, 1, path.stem)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found += _retired(_TEST_NAME_WORDS, file, node.lineno, node.name)
    assert not found, "\n".join(found)


def test_retired_words_are_found_in_names_and_in_text():
    assert list(_retired(_CODE_WORDS, "a.py", 3, "def least_x(self, _footing): # mended")) == [
        "a.py:3: 'footing'; write: plane constraints",
        "a.py:3: 'mended'; write: corrected",
        "a.py:3: 'least_x'; write: min_...",
    ]
    for text in ("np.atleast_2d(x)", "at_most_pi", "trailing", "recommended", "a descent step"):
        assert not list(_retired(_CODE_WORDS, "a.py", 1, text))


def test_every_exception_is_needed():
    for file, word in _EXCEPTIONS:
        assert word in (_ROOT / file).read_text(encoding="utf-8").lower()
