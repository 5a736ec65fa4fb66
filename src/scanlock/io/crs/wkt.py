"""Parser of well-known text (WKT), versions 1 and 2, of coordinate reference systems.

OGC 01-009 defines version 1, and OGC 18-010 (ISO 19162) version 2. Only the structure is parsed:
keywords, their values and the nested nodes.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_TOKEN = re.compile(r'\s*(?:("(?:[^"]|"")*")|([\[(])|([\])])|(,)|([^\s\[\](),"]+))')


@dataclass(frozen=True, slots=True)
class WktNode:
    """A node of well-known text: ``KEYWORD[value, NESTED[...], ...]``."""

    keyword: str
    """Keyword, upper case."""

    values: tuple[str, ...]
    """Values other than nodes, without quotes."""

    children: tuple["WktNode", ...]
    """Nested nodes."""

    @property
    def name(self) -> str:
        """The first value, which is the name of a system, unit or datum."""
        return self.values[0] if self.values else ""

    def child(self, *keywords: str) -> "WktNode | None":
        """Return the first nested node with one of the keywords; None without one."""
        return next((node for node in self.children if node.keyword in keywords), None)

    def search(self, *keywords: str) -> "Iterator[WktNode]":
        """Yield the outermost nodes with one of the keywords, the node itself included."""
        stack: list[WktNode] = [self]
        while stack:
            node = stack.pop()
            if node.keyword in keywords:
                yield node
            else:
                stack.extend(reversed(node.children))


@dataclass(slots=True)
class _OpenNode:
    keyword: str
    values: list[str]
    children: list[WktNode]


def parse_wkt(text: str) -> tuple[WktNode, ...]:
    """Parse well-known text into its outermost nodes.

    Raises
    ------
    ValueError
        Brackets that do not match, or text outside a node.
    """
    root = _OpenNode("", [], [])
    stack = [root]
    position = 0
    text = text.rstrip("\0 \t\r\n")
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            raise ValueError(f"unreadable text at character {position}")
        position = token.end()
        quoted, opening, closing, _, bare = token.groups()
        top = stack[-1]
        if opening:
            if not top.values:
                raise ValueError(f"a bracket without a keyword at character {position - 1}")
            stack.append(_OpenNode(top.values.pop().upper(), [], []))
        elif closing:
            if len(stack) == 1:
                raise ValueError(f"a bracket too many at character {position - 1}")
            done = stack.pop()
            node = WktNode(done.keyword, tuple(done.values), tuple(done.children))
            stack[-1].children.append(node)
        elif quoted is not None:
            top.values.append(quoted[1:-1].replace('""', '"'))
        elif bare is not None:
            top.values.append(bare)
    if len(stack) > 1 or root.values or not root.children:
        raise ValueError("brackets that are not closed" if len(stack) > 1 else "no node")
    return tuple(root.children)
