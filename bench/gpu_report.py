"""Prints docs/gpu.md: what can be known about the GPU tracer's speed without a GPU.

usage: scripts/with_lavapipe python bench/gpu_report.py --cuda FOLDER [--models FILE...]

FOLDER holds bin/nvcc, bin/ptxas, bin/cuobjdump and bin/nvdisasm (wheels cuda-toolkit[nvcc,cudart],
nvidia-cuda-cuobjdump, nvidia-cuda-nvdisasm: nvidia/cu13 among the site-packages). Run it with
LP_NATIVE_VECTOR_WIDTH=512 for waves of 16.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import limitray as lr
from limitray.gpu import RAYS_PER_GROUP
from limitray.gpu_layout import HIT
from limitray.gpu_rays import BufferRays
from limitray.gpu_tracer import open_tracer, slang_folder

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "tests/python"))
from test_gpu_targets import compile_slang  # noqa: E402

ARCHITECTURES = (80, 90, 120)
THREADS_PER_SM = {80: 2048, 90: 2048, 120: 1536}
BLOCKS_PER_SM = {80: 32, 90: 32, 120: 24}
SHARED_PER_SM = {80: 164 << 10, 90: 228 << 10, 120: 100 << 10}
RESERVED = 1 << 10  # shared memory that each workgroup takes besides
REGISTERS_PER_SM = 65536
KERNELS = {"three_lanes": 64, "one_lane": 32}  # threads of a workgroup

# Bytes that a ray reads and arithmetic that it does, by event; counted in the Slang sources.
NODE_BYTES, MODEL_BYTES, NET_BYTES = 12 * 16 + 4, 64, 192
FLOPS = {"node": 3 * 8 * 2 * 2 + 40, "model": 150, "net": 3 * 16 * 4, "newton": 3 * 77 + 60,
         "subpatch": 3 * 256 + 3 * 40}  # fmt: skip
MACHINES = (("K40c", 288e9, 4.29e12), ("RTX 4090", 1008e9, 82.6e12), ("H100 SXM", 3350e9, 66.9e12))


def run(*command):
    """Standard output and error of a command that must succeed."""
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def occupancy(architecture, threads, registers, shared):
    """Share of an SM's threads that registers and shared memory allow.

    Registers come in eights a thread; `threads` and `shared` bytes are those of a workgroup.
    """
    warps = REGISTERS_PER_SM // (32 * (-(-registers // 8) * 8))
    blocks = min(
        warps // (threads // 32),
        SHARED_PER_SM[architecture] // (shared + RESERVED),
        BLOCKS_PER_SM[architecture],
    )
    return min(1.0, blocks * threads / THREADS_PER_SM[architecture])


def compile_table(cuda):
    """Rows of registers, spills, shared memory, instructions and occupancy."""
    with tempfile.TemporaryDirectory() as folder:
        for kernel, threads in KERNELS.items():
            source = Path(folder, f"{kernel}.cu")
            _, code = compile_slang(
                str(REPOSITORY / "src/kernels/closest_hits.cs.slang"), "-target", "cuda",
                "-entry", kernel, "-stage", "compute", "-I", str(REPOSITORY / "src"),
                "-line-directive-mode", "none",
            )  # fmt: skip
            source.write_bytes(code)
            for architecture in ARCHITECTURES:
                ptx, cubin = f"{folder}/a.ptx", f"{folder}/a.cubin"
                nvcc = (f"{cuda}/bin/nvcc", "-w", "-std=c++17", "-ptx")
                run(*nvcc, f"-arch=compute_{architecture}", str(source), "-o", ptx)
                for limit in (255, 128, 96, 80, 64):
                    said = run(
                        f"{cuda}/bin/ptxas", "-v", f"-arch=sm_{architecture}",
                        f"-maxrregcount={limit}", ptx, "-o", cubin,
                    )  # fmt: skip
                    registers = int(re.search(r"Used (\d+) registers", said)[1])
                    spills = re.search(r"(\d+) bytes spill stores, (\d+) bytes spill loads", said)
                    shared = int(re.search(r"(\d+) bytes smem", said)[1])
                    sass = run(f"{cuda}/bin/nvdisasm", "-c", cubin)
                    instructions = len(re.findall(r"^\s+/\*[0-9a-f]+\*/\s", sass, re.MULTILINE))
                    yield (
                        f"sm_{architecture}", kernel, "none" if limit == 255 else limit, registers,
                        f"{spills[1]} / {spills[2]}", shared, instructions,
                        f"{occupancy(architecture, threads, registers, shared):.0%}",
                    )  # fmt: skip


def primary_rays(scene, side):
    """One ray a pixel, in scan order."""
    pixels = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    rays = lr.Camera.frame(scene, aspect=1).rays(*pixels, side, side)
    return rays.reshape(-1, 6).astype(np.float32)


def diffuse_rays(scene, rays, seed=0):
    """Cosine-distributed rays from the hits of `rays`, shuffled."""
    rng = np.random.default_rng(seed)
    hits = scene.cast_rays(rays, attributes=("points",))
    hit = np.isfinite(hits["t_hit"])
    normals, points = hits["primitive_normals"][hit], hits["points"][hit]
    behind = (normals * rays[hit, 3:]).sum(axis=1) > 0
    normals[behind] *= -1
    directions = rng.normal(size=normals.shape)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) + normals
    size = np.ptp(scene.bounds(), axis=0).max()
    made = np.concatenate([points + 1e-4 * size * normals, directions], axis=1)
    return rng.permutation(made).astype(np.float32)


def work_a_ray(scene, rays):
    """The counters of a scene for `rays`, divided by their number."""
    scene.reset_statistics()
    scene.cast_rays(rays)
    return {name: count / len(rays) for name, count in scene.statistics().items()}


def active_groups(scene, rays, per_group):
    """Mean groups of a wave that take part in a round."""
    gpu = scene._scene
    tracer = open_tracer("vulkan", slang_folder())
    kernel = active_groups.__dict__.setdefault("kernel", None)
    if kernel is None:
        path = str(REPOSITORY / "bench/divergence.cs.slang")
        program = tracer.device.load_program(path, ["divergence"])
        kernel = active_groups.__dict__["kernel"] = tracer.device.create_compute_kernel(program)
    source = BufferRays(rays, np.zeros(1), np.full(1, np.inf))
    for _, batch in gpu._batches(source, None):
        batch["batch"]["per_group"] = per_group
        work = tracer.buffer(np.zeros(3, np.uint32))
        hits = tracer.empty_buffer(len(rays) * HIT.itemsize, HIT.itemsize)
        threads = -(-len(rays) // per_group) * 4
        threads = -(-threads // 64) * 64
        kernel.dispatch([threads, 1, 1], {**batch, "hits": hits, "work": work})
        _, groups, waves = tracer.words(work)
        return groups / waves
    raise ValueError("no rays")


def table(head, rows):
    """A Markdown table."""
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print()


def main():
    """Prints the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cuda", required=True, help="folder of a CUDA toolkit")
    cages = [str(REPOSITORY / f"tests/cages/{n}.obj") for n in ("demo", "torus", "cube", "pole_8")]
    parser.add_argument("--models", nargs="*", default=cages, help="OBJ files")
    arguments = parser.parse_args()
    print((REPOSITORY / "bench/gpu_report_text.md").read_text())

    print("## Registers\n")
    head = ("GPU", "kernel", "limit", "registers", "spill bytes, stores / loads", "shared bytes")
    table((*head, "SASS instructions", "occupancy"), compile_table(arguments.cuda))

    work, groups, estimate = [], [], []
    for path in arguments.models:
        scene = lr.Scene(device="vulkan")
        scene.add_mesh(lr.Mesh.from_file(path))
        primary = primary_rays(scene, 128)
        for kind, rays in (("primary", primary), ("diffuse", diffuse_rays(scene, primary))):
            c = work_a_ray(scene, rays)
            name = f"{Path(path).stem}, {kind}"
            events = ("node_visits", "patch_tests", "newton_runs", "newton_steps", "splits")
            nets = c["newton_runs"] + c["early_outs"]
            read = c["node_visits"] * NODE_BYTES + c["patch_tests"] * MODEL_BYTES + nets * NET_BYTES
            flops = (
                c["node_visits"] * FLOPS["node"] + c["patch_tests"] * FLOPS["model"]
                + nets * FLOPS["net"] + c["newton_steps"] * FLOPS["newton"]
                + (c["splits"] + c["backtracks"]) * FLOPS["subpatch"]
            )  # fmt: skip
            work.append((name, *(f"{c[e]:.2f}" for e in events), f"{read:.0f}", f"{flops:.0f}"))
            bounds = (min(b / read, f / flops) / 1e6 for _, b, f in MACHINES)
            estimate.append((name, *(f"{bound:,.0f}" for bound in bounds)))
            one, many = (active_groups(scene, rays, n) for n in (1, RAYS_PER_GROUP))
            groups.append((name, f"{one:.2f}", f"{many:.2f}"))

    print("## Work a ray\n")
    head = ("rays", "nodes", "patch tests", "patches read", "Newton steps", "splits")
    table((*head, "bytes", "operations"), work)
    print("## Upper bounds from these: an estimate, in Mrays/s\n")
    print(
        "The smaller of memory bandwidth (nothing cached) and arithmetic at its peak. Nothing here"
    )
    print("was measured on a GPU. The talk reports 112/48 to 30/19 on a K40c.\n")
    table(("rays", *(name for name, _, _ in MACHINES)), estimate)
    print("## Divergence\n")
    print("Mean groups of a wave that take part in a round, on lavapipe with waves of 16 lanes: 5")
    print("groups at best.\n")
    table(("rays", "one ray a group", f"{RAYS_PER_GROUP} rays a group, taken one by one"), groups)


if __name__ == "__main__":
    main()
