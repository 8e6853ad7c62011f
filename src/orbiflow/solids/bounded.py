"""Reading files from anybody in a process of its own, whose memory and time are bounded.

`python -m orbiflow.solids.bounded FILE BYTES SECONDS` is that process. What a hostile file does to a
reader ends there, in one error.
"""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.solids.package_files import read_3mf
from orbiflow.solids.soup import Soup
from orbiflow.solids.trimesh_files import read_gltf

MAX_MEMORY = 8 * 2**30
"""Bytes of memory at most, where the system bounds it: all but Windows."""

MAX_SECONDS = 120
"""Seconds of processor time at most, where the system bounds it."""

MAX_WAIT = 1200
"""Seconds until a process that hangs is ended, on any system."""

REFUSED = 3
"""The status of a process that says why it has refused a file."""

TOO_MUCH = (
    "is broken, or takes more memory or time than a mesh needs; simplify it, or export it again"
)


def read_bounded(path: Path, *, memory: int = MAX_MEMORY, seconds: int = MAX_SECONDS) -> Soup:
    """Return all triangles of a 3MF, glTF or GLB file, in mm, read in a process of its own.

    Raises `OrbiflowError` for a file that cannot be read within the bounds.
    """
    paths = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    try:
        done = subprocess.run(
            # -P: nothing beside the mesh is imported
            [
                *(sys.executable, "-P", "-m", "orbiflow.solids.bounded"),
                *(str(path.resolve()), str(memory), str(seconds)),
            ],
            env={**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=MAX_WAIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise OrbiflowError(TOO_MUCH) from None
    if done.returncode == REFUSED:
        raise OrbiflowError(done.stdout.decode())
    if done.returncode:
        raise OrbiflowError(TOO_MUCH)
    arrays = np.load(io.BytesIO(done.stdout), allow_pickle=False)
    return Soup(**{name: arrays[name] for name in arrays})


def read_here(path: Path) -> Soup:
    """Read such a file in this process."""
    data = path.read_bytes()
    return read_3mf(data) if path.suffix.lower() == ".3mf" else read_gltf(data, path)


def _bound(memory: int, seconds: int) -> None:
    """Bound the memory and the processor time of this process, where the system can."""
    if sys.platform == "win32":
        return
    import resource

    limits = {"RLIMIT_AS": memory, "RLIMIT_CPU": seconds, "RLIMIT_CORE": 0}
    for name, most in limits.items():
        with suppress(OSError, ValueError, OverflowError):  # a lower bound than this stays
            resource.setrlimit(getattr(resource, name), (most, most))


def _main() -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints
    path, memory, seconds = sys.argv[1:]
    _bound(int(memory), int(seconds))
    try:
        soup, content = read_here(Path(path)), io.BytesIO()
        np.savez(content, **{k: array for k, array in soup._asdict().items() if array is not None})
        output.write(content.getbuffer())
        output.close()
        return 0
    except OrbiflowError as error:
        output.write(str(error).encode(errors="replace"))
        return REFUSED


if __name__ == "__main__":
    sys.exit(_main())
