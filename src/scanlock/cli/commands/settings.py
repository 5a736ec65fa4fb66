"""``scanlock settings``: every setting of a method, to change and to give back."""

from scanlock.cli.option_types import MethodName, OutputFile


def settings(method: MethodName, /, *, output: OutputFile = None) -> None:
    """Print every setting of a method as TOML, defaults and all.

    Parameters
    ----------
    method : str
        Which method.
    output : Path
        A file to write instead, ending in .toml; register takes it with --settings.
    """
    import sys

    from scanlock.cli.console import print_line
    from scanlock.cli.output import make_room, require_ending
    from scanlock.registration.registry import named_method
    from scanlock.registration.settings.file import settings_to_toml, write_settings

    _, chosen = named_method(method)
    if output is None:
        sys.stdout.write(settings_to_toml(chosen))
        return
    require_ending(output, (".toml",), "the file of settings")
    make_room(output)
    write_settings(output, chosen)
    print_line(f"wrote {output}")
