"""Write the table of kernels with their signatures, for compilation in parallel.

    python -m benchmarks.speed.kernel_table [--json FILE]

Runs a registration by the default method, then ``scanlock warmup``, each in a new process, and
records the kernels that Python calls with the types of their arguments: the default ones first,
then by the size of the machine code, largest first.
"""

import json
import subprocess
import sys
from typing import Any

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock.registration.compile_ahead import TABLE

RECORD = """
import importlib, json, pathlib, pkgutil, sys
import scanlock, scanlock.kernels
from scanlock.cli.commands import warm_up
from scanlock.registration import register as _, warm_up as steps

steps.run_default() if sys.argv[1] == "default" else warm_up.run_all()
found = {}
for module in pkgutil.walk_packages(scanlock.kernels.__path__, "scanlock.kernels."):
    for name, kernel in vars(importlib.import_module(module.name)).items():
        if name.startswith("_") or getattr(kernel, "__module__", "") != module.name:
            continue
        for signature in getattr(kernel, "nopython_signatures", ()):
            if kernel.stats.cache_path is None:
                continue  # a helper, which Python does not call
            folder = pathlib.Path(kernel.stats.cache_path)
            size = max(
                one.stat().st_size
                for one in folder.glob(f"*.{name}-*.nbc")
            )
            key = module.name.removeprefix("scanlock.kernels.") + "." + name
            found[key] = [[repr(one) for one in signature.args], size]
print(json.dumps(found))
"""


def record(stage: str) -> dict[str, Any]:
    """Return the kernels of a stage, with types and sizes."""
    done = subprocess.run(
        [sys.executable, "-c", RECORD, stage], check=True, stdout=subprocess.PIPE, text=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def table_rows() -> list[list[Any]]:
    """Return the rows of the table: name, types and whether the default method calls it."""
    default, every = record("default"), record("all")
    order = sorted(every, key=lambda name: (name not in default, -every[name][1]))
    return [[name, every[name][0], name in default] for name in order]


def main() -> None:
    arguments = make_parser(__doc__).parse_args()
    results = Results(arguments.json)
    rows = table_rows()
    text = ",\n".join(json.dumps(row) for row in rows)
    TABLE.write_text(f"[\n{text}\n]\n", encoding="utf-8")
    counts = [["default method", str(sum(row[2] for row in rows))], ["all", str(len(rows))]]
    results.add_table(["kernels", "number"], counts, title="kernels that Python calls")


if __name__ == "__main__":
    main()
