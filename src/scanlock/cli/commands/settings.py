"""``scanlock settings``: every setting of a method, to change and to give back."""

from scanlock.cli.option_types import MethodName, OutputFile

_SEGMENT = "segment"
"""Name of the settings of scanlock segment."""


def settings(method: MethodName, /, *, output: OutputFile = None) -> None:
    """Print every setting of a method as TOML, defaults and all.

    Parameters
    ----------
    method : str
        Which method, or segment for the settings of scanlock segment.
    output : Path
        A file to write instead, ending in .toml; register takes it with --settings.
    """
    import sys

    from scanlock.cli.console import print_line
    from scanlock.cli.output import require_ending
    from scanlock.io.atomic import atomic_file
    from scanlock.registration.registry import named_method
    from scanlock.registration.settings.file import settings_to_toml
    from scanlock.registration.settings.text import settings_text
    from scanlock.segmentation.segmentation import Segmenter

    if method == _SEGMENT:
        text = settings_text(Segmenter())
    else:
        text = settings_to_toml(named_method(method)[1])
    if output is None:
        sys.stdout.write(text)
        return
    require_ending(output, (".toml",), "the file of settings")
    with atomic_file(output) as handle:
        handle.write(text.encode())
    print_line(f"wrote {output}")
