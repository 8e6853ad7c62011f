"""How long certificates take: tiles of the nine classes, beside an earlier commit; and other tilings.

    python benchmarks/tilings.py                # this code alone
    python benchmarks/tilings.py --old COMMIT   # and that commit's, in interleaved pairs

Each side runs in a process of its own, which builds the same tiles anew in every round and certifies
them; a pair is one round of each, one after the other. CPU seconds of the whole round; ratios are
medians over the pairs.
"""

from __future__ import annotations

import argparse
import io
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

WORKER = '''
import sys, time
import numpy as np
try:
    from orbiflow.tiles import CLASSES, Tile, certify
except ImportError:  # version 0.1
    from orbiflow.tilings import CLASSES, Tile, certify

def bent(kind, per_edge, rng):
    """A tile with random edges: one of each pair, or half of an edge with a centre, and its images."""
    corners, edges = kind.template(), {}
    for pair in kind.identified_edges:
        isometry = kind.edge_isometry(pair) if hasattr(kind, "edge_isometry") else pair.isometry
        start, end = corners[pair.first], corners[(pair.first + 1) % len(corners)]
        share = np.linspace(0, 1, per_edge + 1)[:, None]
        waves = sum(rng.normal() * np.sin(np.pi * k * share) / k**2 for k in range(1, 6))
        across = np.array([start[1] - end[1], end[0] - start[0]])
        own = start + share * (end - start) + 0.05 * waves * across
        if pair.folded:
            half = own[: per_edge // 2 + 1].copy()
            half[-1] = (start + end) / 2
            edges[pair.first] = np.concatenate([half, isometry(half)[-2::-1]])
        else:
            image = isometry(own)
            edges[pair.first], edges[pair.second] = own, image[::-1] if pair.reversed else image
    return np.concatenate([edges[k][:-1] for k in range(len(corners))])

rings = {
    per_edge: [
        (bent(kind, per_edge, np.random.default_rng(7)), kind.group()) for kind in CLASSES.values()
    ]
    for per_edge in map(int, sys.argv[1:])
}
print("ready", flush=True)
for line in sys.stdin:
    chosen = rings[int(line)]
    begin = time.process_time()
    valid = sum(certify(Tile(ring, group)).valid for ring, group in chosen)
    print(time.process_time() - begin, valid, flush=True)
'''


class Side:
    """A process that certifies with the package found in `source`."""

    def __init__(self, source: Path, sizes: list[int]) -> None:
        environment = {**os.environ, "PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, *map(str, sizes)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self._line() == "ready"

    def round(self, size: int) -> float:
        """CPU seconds for the nine classes' tiles of that many sides an edge."""
        assert self.process.stdin
        self.process.stdin.write(f"{size}\n")
        self.process.stdin.flush()
        seconds, valid = self._line().split()
        if valid != "9":
            raise SystemExit(f"only {valid} of the 9 tiles were certified")
        return float(seconds)

    def _line(self) -> str:
        assert self.process.stdout
        return self.process.stdout.readline().strip()

    def close(self) -> None:
        """End it."""
        assert self.process.stdin
        self.process.stdin.close()
        self.process.wait()


def earlier(commit: str, folder: str) -> Path:
    """The package as it was."""
    packed = subprocess.run(
        ["git", "-C", str(ROOT), "archive", commit, "src/orbiflow"], capture_output=True, check=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
    return Path(folder) / "src"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--old", metavar="COMMIT", help="an earlier commit to compare with")
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="two pairs")
    given = parser.parse_args()
    sizes, pairs = [2, 10, 40, 200], 2 if given.quick else given.pairs
    with tempfile.TemporaryDirectory() as folder:
        sides = [Side(ROOT / "src", sizes)]
        if given.old:
            sides.append(Side(earlier(given.old, folder), sizes))
        heading = f"{'before':>12}{'ratio':>10}" if given.old else ""
        print(f"{'sides an edge':>14}{'ms a tile':>12}{heading}")
        for size in sizes:
            for side in sides:
                side.round(size)  # caches are full now
            rounds = [[side.round(size) for side in sides] for _ in range(pairs)]
            line = "".join(
                f"{1000 / 9 * statistics.median(column):12.2f}"
                for column in zip(*rounds, strict=True)
            )
            if given.old:
                line += f"{statistics.median(new / old for new, old in rounds):10.2f}"
            print(f"{size:14d}{line}")
        for side in sides:
            side.close()


if __name__ == "__main__":
    main()
