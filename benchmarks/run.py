"""Run the benchmarks and print one table. Ratios belong to this machine and this run; they fail nothing."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

NAMES = (
    "startup",
    "mechanisms",
    "enclosures",
    "volume",
    "certified_volume",
    "certificate",
    "screening",
    "workers",
    "cluster",
    "study",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which of {', '.join(NAMES)}; default all")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table here")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(NAMES))
    if unknown:
        parser.error(f"unknown benchmark {', '.join(unknown)}; there are {', '.join(NAMES)}")
    # one thread for everybody
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")
    rows = [asdict(row) for name in arguments.names or NAMES for row in import_module(name).rows()]
    for row in rows:
        row["met"] = {True: "yes", False: "no", None: "-"}[row["met"]]
    heads = ("name", "ours", "peer", "ratio", "target", "met")
    widths = {head: max(len(head), *(len(row[head]) for row in rows)) for head in heads}
    for row in ({head: head for head in heads}, *rows):
        print("  ".join(row[head].ljust(widths[head]) for head in heads).rstrip())
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
