"""The paper, reproduced: each figure and table as an exhibit, drawn beside what the paper states."""

from reproduction.exhibit import (
    Exhibit,
    Findings,
    Shown,
    Table,
    Work,
)
from reproduction.exhibits import EXHIBITS
from reproduction.extent import (
    FAST,
    FULL,
    Extent,
)
from reproduction.folder import write_page, written_files
from reproduction.page import paper_page
from reproduction.reproduction import reproduce

__all__ = [
    "EXHIBITS",
    "FAST",
    "FULL",
    "Exhibit",
    "Extent",
    "Findings",
    "Shown",
    "Table",
    "Work",
    "paper_page",
    "reproduce",
    "write_page",
    "written_files",
]
