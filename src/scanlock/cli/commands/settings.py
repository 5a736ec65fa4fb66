"""``scanlock settings``: print the settings of a method, to change and to use again."""

from scanlock.cli.option_types import Flag, MethodName, OutputFile

_SEGMENT = "segment"
"""Name of the settings of scanlock segment."""


def settings(method: MethodName, /, *, all: Flag = False, output: OutputFile = None) -> None:
    """Print the settings of a method that are changed most often, as TOML.

    Parameters
    ----------
    method : str
        Which method, or segment for the settings of scanlock segment, which are always all.
    all : bool
        Every setting, defaults and all.
    output : Path
        A file to write instead, ending in .toml; register takes it with --settings.
    """
    import sys

    from scanlock.cli.console import print_line
    from scanlock.cli.output import require_ending
    from scanlock.io.atomic import atomic_file

    text = _text(method, all)
    if output is None:
        sys.stdout.write(text)
        return
    require_ending(output, (".toml",), "the file of settings")
    with atomic_file(output) as handle:
        handle.write(text.encode())
    print_line(f"wrote {output}")


def _text(method: MethodName, all: bool) -> str:
    from scanlock.registration.registry import named_method
    from scanlock.registration.settings.file import settings_to_toml
    from scanlock.registration.settings.key_settings import key_settings_to_toml
    from scanlock.registration.settings.text import settings_text
    from scanlock.segmentation.segmentation import Segmenter

    if method == _SEGMENT:
        return settings_text(Segmenter())
    name, chosen = named_method(method)
    if all:
        return settings_to_toml(chosen)
    return f"# All settings: scanlock settings {name} --all\n{key_settings_to_toml(name)}"
