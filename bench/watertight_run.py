#!/usr/bin/env python3
"""A long watertight run of one build: rounds of bench/watertight over the closed cages.

Each round has a new seed; all instruction sets take turns, doubles and pure bisection come between
them, until enough rays are counted. Prints progress and, at the end (also after Ctrl-C), the table
of docs/accuracy.md.

    python3 bench/watertight_run.py --program build/release/bench/watertight --rays 1e9
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import itertools
import json
import os
import pathlib
import subprocess
import sys
import tempfile

root = pathlib.Path(__file__).parent.parent
cages = """cube cube_corners cube_inf_loop cube_seams cube_semi_2_5 dart_infinite icosahedron
    pole_12 pole_5 prism_5 star_prism tetrahedron torus torus_creases""".split()


def rounds(isas: list[str], first_seed: int):
    """Instruction set, options, rays a cage and seed, for ever: mostly float, S8 and the widest."""
    others = isas[1:] or isas
    for seed in itertools.count(first_seed):
        isa = isas[0] if seed % 4 else others[seed // 4 % len(others)]
        yield isa, [], 1_000_000, seed
        if seed % 12 in (0, 5):
            for option in ("--double", "--bisection"):
                yield isa, [option], 20_000, seed


def run(program: str, isa: str, options: list[str], rays: int, seed: int) -> list[dict]:
    """One round: a row of counts for each cage."""
    with tempfile.NamedTemporaryFile("r", suffix=".json") as out:
        files = [str(root / "tests" / "cages" / f"{cage}.obj") for cage in cages]
        command = [program, "--rays", str(rays), "--seed", str(seed), "--json", out.name, *options]
        done = subprocess.run(
            [*command, *files],
            env={**os.environ, "LIMITRAY_ISA": isa},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        rows = [json.loads(line) for line in out]
    if done.returncode not in (0, 1) or len(rows) != len(cages):
        line = " ".join(command)
        raise RuntimeError(f"{line} ({isa}): exit code {done.returncode}\n{done.stdout}")
    return rows


def table(rows: list[dict]) -> str:
    """The sums of all rows, as Markdown."""
    keys = ("type", "search", "isa")
    sums: dict = collections.defaultdict(lambda: [0, 0, 0, 0])
    for row in rows:
        values = [row[k] for k in ("rays", "leaks", "unresolved", "beyond")]
        for key in (tuple(row[k] for k in keys), ("**all**", "", "")):
            sums[key] = [a + b for a, b in zip(sums[key], values, strict=True)]
    lines = [
        "| number type | search | instruction set | rays | leaks | unresolved | beyond |",
        "|---|---|---|---|---|---|---|",
    ]
    for key in sorted(sums, key=lambda k: (k[0] == "**all**", k)):
        cells = [*key, *(f"{n:,}".replace(",", " ") for n in sums[key])]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> int:
    """Runs rounds until enough rays are counted; 1 if one leaked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--program", default=str(root / "build/release/bench/watertight"))
    parser.add_argument("--rays", type=float, default=1e9, help="in all; %(default)s unless given")
    parser.add_argument("--seed", type=int, default=1, help="of the first round")
    parser.add_argument("--isas", default="avx512,avx2,portable", help="the first one most often")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    rows: list[dict] = []
    work = rounds(options.isas.split(","), options.seed)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        running = set()
        try:
            while running or sum(row["rays"] for row in rows) < options.rays:
                enough = sum(row["rays"] for row in rows) >= options.rays
                while not enough and len(running) < options.jobs:
                    running.add(pool.submit(run, options.program, *next(work)))
                wait = concurrent.futures.wait(running, return_when="FIRST_COMPLETED")
                running = wait.not_done
                for finished in wait.done:
                    rows += finished.result()
                leaks = sum(row["leaks"] + row["unresolved"] for row in rows)
                count = sum(row["rays"] for row in rows)
                print(f"\r{count / 1e6:.0f} million rays, {leaks} leaks", end="", file=sys.stderr)
        except KeyboardInterrupt:
            print("\nstopped early", file=sys.stderr)
    print(file=sys.stderr)
    print(table(rows))
    return 1 if any(row["leaks"] or row["unresolved"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
