"""Notes of a solution for the user: text, or text with lengths."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class LengthNote:
    """A note with lengths, which are converted to metres with those of the solution.

    Attributes
    ----------
    text : str
        Text with a replacement field for each length: ``"the spacing is {:.3g} m"``.
    lengths : tuple of float
        Lengths in the unit of the solution: metres, or for sparse scans the length scale.
    """

    text: str
    lengths: tuple[float, ...]

    def __str__(self) -> str:
        return self.text.format(*self.lengths)

    def scaled(self, factor: float) -> "LengthNote":
        """Return the note with its lengths times a factor."""
        return replace(self, lengths=tuple(factor * length for length in self.lengths))


Note = str | LengthNote
"""A note, which is empty text where there is nothing to say."""
