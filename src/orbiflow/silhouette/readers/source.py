"""Where a silhouette is read from: a file, or the bytes of one."""

import io
from dataclasses import dataclass
from pathlib import Path, PurePath


@dataclass(frozen=True)
class Held:
    """The content of a file, in memory, under a name: what messages call it, and its ending."""

    data: bytes
    name: str

    @property
    def suffix(self) -> str:
        """Ending of the name, such as ".svg"."""
        return PurePath(self.name).suffix

    def __str__(self) -> str:
        return self.name


Source = Path | Held


def opened(source: Source) -> Path | io.BytesIO:
    """What libraries open: the path, or a stream of the bytes."""
    return io.BytesIO(source.data) if isinstance(source, Held) else source
