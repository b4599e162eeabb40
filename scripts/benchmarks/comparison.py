# SPDX-License-Identifier: GPL-3.0-or-later
"""How long `rockfall compare` takes with figures and page, and how much memory and room: small and large tables."""

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from analysis import made_impacts
from rockfall.core.exchange.tables import write_impacts

SIZES = (100, 20_000, 90_000)


def measured(impacts: int) -> str:
    """One line: impacts, processor time of the whole command, its greatest memory, size of page and figures."""
    with tempfile.TemporaryDirectory() as folder:
        table, out = Path(folder) / "impacts.csv", Path(folder) / "out"
        write_impacts(made_impacts(impacts // 10, 10), table)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "rockfall.core.cli", "compare", str(table), "--out", str(out)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        page = (out / "report.html").stat().st_size
        figures = sum(path.stat().st_size for path in (out / "figures").iterdir())
        return f"{impacts:>8}{seconds:>9.1f}{after.ru_maxrss / 1e6:>9.2f}{page / 1e6:>9.1f}{figures / 1e6:>12.1f}"


def main() -> None:
    """Print a line for each size, the smallest first, because the greatest memory is that of all children so far."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, nargs="+", default=SIZES)
    print(f"{'impacts':>8}{'CPU [s]':>9}{'GB':>9}{'page MB':>9}{'figures MB':>12}")
    for impacts in sorted(parser.parse_args().impacts):
        print(measured(impacts), flush=True)


if __name__ == "__main__":
    main()
