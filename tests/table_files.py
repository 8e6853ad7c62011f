"""Writing and refusing tables, shared by the tests of what reads them."""

from pathlib import Path

from hypothesis import HealthCheck, settings

from orbiflow.density import read_table
from orbiflow.errors import InputFileError
from refusals import refused

PROPERTY = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def write(tmp_path: Path, content: str | bytes, name: str = "a.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refuse(path: Path, about: str, columns: list[str] | None = None, width: int | None = 2) -> None:
    """Reading a file is refused, by words that name the file and all that it is about."""
    with refused(*about.split(), kind=InputFileError) as caught:
        read_table(path, columns=columns, width=width)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 2 * len(str(path)) + 400
