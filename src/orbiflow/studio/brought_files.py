"""The table or mesh that was brought to a project, as it was uploaded."""

from __future__ import annotations

from pathlib import Path

from orbiflow.errors import OrbiflowError

ENDINGS = {
    "table": (".csv", ".tsv", ".txt", ".npy"),
    "mesh": (".stl", ".obj", ".ply", ".3mf", ".gltf", ".glb"),
}
CURES = {"table": "save yours as CSV and give that", "mesh": "export yours as one of them"}


def brought_file(home: Path, kind: str) -> Path:
    """Return the file of a kind in a project's folder."""
    files = [path for ending in ENDINGS[kind] if (path := home / f"{kind}{ending}").is_file()]
    if not files:
        raise OrbiflowError(f"there is no {kind} in this project; bring one")
    return files[0]


def place_of(home: Path, kind: str, name: str) -> Path:
    """Return where a file of this kind and name is kept, or refuse it."""
    ending = Path(name).suffix.lower()
    if ending not in ENDINGS[kind]:
        endings = ", ".join(ENDINGS[kind])
        raise OrbiflowError(f"a {kind}'s name ends in {endings}; {CURES[kind]}")
    return home / f"{kind}{ending}"
