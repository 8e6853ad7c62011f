"""The paper, reproduced: each figure and table as an exhibit, drawn beside what the paper states."""

from orbiflow.paper.exhibit import Exhibit, Findings, Shown, Table, Work
from orbiflow.paper.exhibits import EXHIBITS
from orbiflow.paper.extent import FAST, FULL, Extent
from orbiflow.paper.folder import write_page, written_files
from orbiflow.paper.page import paper_page
from orbiflow.paper.reproduction import reproduce

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
