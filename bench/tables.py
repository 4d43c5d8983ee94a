#!/usr/bin/env python3
"""Runs limitray_bench over models and writes the tables of docs/performance.md.

    bench/tables.py --program build/release/bench/limitray_bench [--models FOLDER] [--rays 1e6]
                    [--rounds 5] [--parts speed,threads,isa,growth] [--results build/tables]
                    [--reuse] [--write docs/performance.md]

Each run leaves its JSON in the results folder; --reuse takes what is there instead of running
again, so that one part can be repeated. Without --write the tables go to standard output. Needs
the limitray package (it reads the USD model).
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from large_cages import write_large_cage

REPOSITORY = Path(__file__).parents[1]
BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"
PEERS = [f"embree-subdivision-{n}" for n in (4, 8, 16, 32)]
PEERS += [*(f"embree-triangles-{n}" for n in (4, 8, 16, 32, 64)), "embree-geometry"]
FEWER_PEERS = ["embree-subdivision-8", "embree-subdivision-16", "embree-triangles-4"]
FEWER_PEERS += ["embree-triangles-8", "embree-geometry"]  # of the large cage: the others don't fit
MODELS = {
    "spot": "crane/spot_control_mesh.obj",
    "catmark_car": "opensubdiv/catmark_car.obj",
    "makehuman_base": "human/makehuman_base.obj",
    "FancyTeapot": "usd/FancyTeapot.usd",
}
LARGE = 210_000
GROWTH = [1_000, 8_000, 60_000, 240_000, 1_000_000]
EXACT = 1e-6  # mean error, relative to the extent


class Bench:
    """Runs the program, or takes the result of an earlier run."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.reports = []
        arguments.results.mkdir(parents=True, exist_ok=True)

    def run(self, name, cage, tracers, threads=1, isa=None):
        """The report of one run, kept in <name>.json."""
        file = self.arguments.results / f"{name}.json"
        if not (self.arguments.reuse and file.exists()):
            command = [str(self.arguments.program), str(cage), "--threads", str(threads)]
            command += ["--rays", self.arguments.rays, "--rounds", str(self.arguments.rounds)]
            command += ["--tracers", ",".join(tracers), "--json", str(file)]
            environment = os.environ | ({"LIMITRAY_ISA": isa} if isa else {})
            load = round(os.getloadavg()[0], 1)
            print(f"tables: {name}, load {load}", file=sys.stderr)
            subprocess.run(
                command, check=True, env=environment, stdout=subprocess.DEVNULL, stderr=None
            )
            file.write_text(json.dumps({**json.loads(file.read_text()), "load": load}))
        report = json.loads(file.read_text())
        self.reports.append(report)
        return report

    def cages(self):
        """Names and files of the models that are there, and of the large cage."""
        cages = {}
        for name, path in MODELS.items():
            source = self.arguments.models / path
            if not source.exists():
                print(f"tables: {source}: not there, left out", file=sys.stderr)
                continue
            cages[name] = source if source.suffix == ".obj" else self.converted(source)
        cages["organic"] = self.large_cage(LARGE)
        return cages

    def converted(self, source):
        """A USD model as OBJ."""
        from limitray.mesh import Mesh
        from limitray.obj import write_obj

        cage = self.arguments.results / f"{source.stem}.obj"
        write_obj(Mesh.from_file(source), cage)
        return cage

    def large_cage(self, count):
        """An organic cage of about `count` faces."""
        cage = self.arguments.results / f"organic_{count}.obj"
        write_large_cage(count, cage)
        return cage


def table(head, rows):
    """Lines of a Markdown table; numbers to the right."""
    yield "| " + " | ".join(head) + " |"
    yield "|---" + "|---:" * (len(head) - 1) + "|"
    yield from ("| " + " | ".join(row) + " |" for row in rows)
    yield ""


def rows_of(report, kind):
    """Measured rows by tracer."""
    return {r["tracer"]: r for r in report["rows"] if r["rays"] == kind and "skipped" not in r}


def speed(row):
    """Millions of rays a processor second."""
    return row["mrays_per_processor_s"]


def factor(number):
    """A ratio with two or three digits."""
    return f"{number:.2f}x" if number < 10 else f"{number:.0f}x"


def ratio(report, tracer, kind):
    """How many times faster limitray is than a peer; - if that did not run."""
    row = rows_of(report, kind).get(tracer)
    return factor(speed(rows_of(report, kind)["limitray"]) / speed(row)) if row else "-"


def exact_triangles(report, kind):
    """Against the coarsest triangles that are exact, or the finest there are, with their error."""
    rows = [r for name, r in rows_of(report, kind).items() if "triangles" in name]
    if not rows:
        return "-"
    exact = [r for r in rows if r["mean_error"] <= EXACT]
    row = exact[0] if exact else rows[-1]
    quads = row["tracer"].rpartition("-")[2]
    note = "" if exact else f", error {row['mean_error']:.0e}"
    return f"{ratio(report, row['tracer'], kind)} ({quads}x{quads}{note})"


def build_ratio(report, member):
    """Bytes or processor seconds of triangles 8x8 over limitray's."""
    rows = rows_of(report, "primary")
    peer = rows.get("embree-triangles-8")
    return factor(peer[member] / rows["limitray"][member]) if peer else "does not fit"


def summary_rows(reports):
    """One line a model: what issue 5's goals ask for."""
    for name, report in reports.items():
        ours = rows_of(report, "primary")["limitray"]
        update = ours["build_processor_s"] / report["update_points_processor_s"]
        for kind in ("primary", "diffuse"):
            yield [
                f"{name}, {report['faces']:,} faces",
                kind,
                f"{speed(rows_of(report, kind)['limitray']):.2f}",
                ratio(report, "embree-subdivision-16", kind),
                ratio(report, "embree-triangles-4", kind),
                exact_triangles(report, kind),
                build_ratio(report, "bytes") if kind == "primary" else "",
                build_ratio(report, "build_processor_s") if kind == "primary" else "",
                factor(update) if kind == "primary" else "",
            ]


def tracer_rows(report):
    """One line a tracer, both kinds of ray."""
    primary, diffuse = rows_of(report, "primary"), rows_of(report, "diffuse")
    for name, row in primary.items():
        other = diffuse[name]
        yield [
            name,
            f"{speed(row):.2f}",
            f"{speed(other):.2f}",
            f"{row['build_processor_s']:.3f}",
            f"{row['bytes'] / 2**20:,.1f}",
            f"{row['mean_error']:.1e}",
            f"{row['max_error']:.1e}",
            f"{row['mismatches']:,} / {other['mismatches']:,}",
        ]


def work_row(name, report, kind):
    """Counts a ray, which do not depend on the machine."""
    work = rows_of(report, kind)["limitray"]["per_ray"]
    return [name, kind, *(f"{work[key]:.2f}" for key in work if key != "unresolved")]


def speed_part(bench):
    """The models against all peers, one thread."""
    reports = {
        name: bench.run(f"speed_{name}", cage, FEWER_PEERS if name == "organic" else PEERS)
        for name, cage in bench.cages().items()
    }
    yield "### Against Embree, one thread"
    yield ""
    head = ["cage", "rays", "Mray a CPU s", "rays/s, subdivision 16", "triangles 4x4"]
    head += ["triangles of error <= 1e-6", "bytes, triangles 8x8", "build, triangles 8x8"]
    yield from table([*head, "update_points, rebuild"], summary_rows(reports))
    yield "A factor above 1 means that limitray is that many times better."
    yield ""
    work = next(iter(reports.values()))["rows"][0]["per_ray"]
    names = [key.replace("_", " ") for key in work if key != "unresolved"]
    yield "Work a ray:"
    yield ""
    rows = [work_row(n, r, k) for n, r in reports.items() for k in ("primary", "diffuse")]
    yield from table(["cage", "rays", *names], rows)
    for name, report in reports.items():
        yield f"{name}, {report['faces']:,} faces, {report['patches']:,} patches:"
        yield ""
        head = ["tracer", "primary Mray a CPU s", "diffuse", "build CPU s", "MiB", "mean error"]
        yield from table([*head, "max error", "mismatches"], tracer_rows(report))
        for row in report["rows"]:
            if "skipped" in row and row["rays"] == "primary":
                yield f"{row['tracer']}: left out, {row['skipped']}."
                yield ""


def threads_part(bench):
    """All threads against one, by the clock on the wall."""
    rows = []
    for name, cage in bench.cages().items():
        report = bench.run(f"threads_{name}", cage, ["limitray"], threads=0)
        for kind in ("primary", "diffuse"):
            of = rows_of(report, kind)
            many, one = (of[t]["mrays_per_s"] for t in ("limitray", "limitray-1-thread"))
            row = [name, kind, str(report["threads"]), f"{many:.2f}", f"{one:.2f}"]
            rows.append([*row, factor(many / one)])
    yield "### Threads, wall clock"
    yield ""
    yield from table(["cage", "rays", "threads", "Mray/s", "Mray/s on one", "gain"], rows)


def isa_part(bench):
    """AVX2 against AVX-512, each beside Embree's triangles in the same process as a yardstick."""
    peer = "embree-triangles-4"
    rows = []
    for name, cage in bench.cages().items():
        reports = [bench.run(f"isa_{i}_{name}", cage, [peer], isa=i) for i in ("avx2", "avx512")]
        for kind in ("primary", "diffuse"):
            narrow, wide = (rows_of(report, kind) for report in reports)
            rates = [speed(of["limitray"]) for of in (narrow, wide)]
            relative = [rate / speed(of[peer]) for rate, of in zip(rates, (narrow, wide))]
            gain = factor(relative[0] / relative[1])
            rows.append([name, kind, f"{rates[0]:.2f}", f"{rates[1]:.2f}", gain])
    yield "### AVX2 against AVX-512"
    yield ""
    yield f"Each process traces {peer}, too: the ratio is of limitray's speeds over that yardstick."
    yield ""
    head = ["cage", "rays", "AVX2, Mray a CPU s", "AVX-512", "AVX2 / AVX-512"]
    yield from table(head, rows)


def growth_part(bench):
    """The same body in ever finer cages."""
    peer = "embree-triangles-4"
    rows = []
    for count in GROWTH:
        report = bench.run(f"growth_{count}", bench.large_cage(count), [peer])
        row = [f"{report['faces']:,}", f"{report['patches']:,}"]
        for kind in ("primary", "diffuse"):
            row += [
                f"{speed(rows_of(report, kind)['limitray']):.2f}",
                ratio(report, peer, kind),
            ]
        ours = rows_of(report, "primary")["limitray"]
        row += [f"{ours['build_processor_s']:.3f}", f"{ours['bytes'] / 2**20:,.1f}"]
        rows.append([*row, build_ratio_of(report, peer)])
    yield "### Growth"
    yield ""
    head = ["faces", "patches", "primary Mray a CPU s", "over triangles 4x4", "diffuse"]
    head += ["over triangles 4x4", "build CPU s", "MiB", "bytes, triangles 4x4"]
    yield from table(head, rows)


def build_ratio_of(report, peer):
    """Bytes of a peer over limitray's."""
    rows = rows_of(report, "primary")
    return factor(rows[peer]["bytes"] / rows["limitray"]["bytes"]) if peer in rows else "-"


PARTS = {"speed": speed_part, "threads": threads_part, "isa": isa_part, "growth": growth_part}


def provenance(bench, command):
    """Where and how the figures were taken."""
    machine = bench.reports[0]["machine"]
    commits = ", ".join(sorted({report["machine"]["commit"] for report in bench.reports}))
    yield f"- machine: {machine['cpu']}, {machine['cores']} cores, {machine['system']}"
    yield f"- compiler: {machine['compiler']}, `{machine['flags']}`; Embree {machine['embree']}"
    yield f"- instruction set: {machine['isa']}, where the table does not name another"
    yield f"- commit: {commits}"
    loads = [report["load"] for report in bench.reports]
    yield f"- load of the machine as the runs began: {min(loads)} to {max(loads)}"
    yield f"- command: `{command}`"
    yield ""


def written_into(text, tables):
    """`text` with what stands between the marks replaced."""
    before, _, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise SystemExit(f"tables: no lines {BEGIN} and {END} to write between")
    return f"{before}{BEGIN}\n{tables}{END}{after}"


def main():
    """Runs the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--program", type=Path, required=True)
    default = Path(os.environ.get("LIMITRAY_MODELS", REPOSITORY.parent / "shared/models"))
    parser.add_argument("--models", type=Path, default=default)
    parser.add_argument("--rays", default="1e6")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--results", type=Path, default=REPOSITORY / "build/tables")
    parser.add_argument("--reuse", action="store_true")
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    parts = arguments.parts.split(",")
    for part in parts:
        if part not in PARTS:
            parser.error(f'--parts: "{part}" is not one of {", ".join(PARTS)}')
    bench = Bench(arguments)
    tables = [line for part in parts for line in PARTS[part](bench)]
    command = f"bench/tables.py --rays {arguments.rays} --rounds {arguments.rounds}"
    text = "\n".join(["", *provenance(bench, command), *tables, ""])
    if arguments.write:
        arguments.write.write_text(written_into(arguments.write.read_text(), text))
    else:
        print(text)


if __name__ == "__main__":
    main()
