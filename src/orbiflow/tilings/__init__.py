"""Isohedral classes, tiles, their certificates, patches and colourings."""

from orbiflow.tilings.certificate import Certificate, certify
from orbiflow.tilings.class_table import EdgePair
from orbiflow.tilings.classes import CLASSES, IsohedralClass, PaperOperator, isohedral_class
from orbiflow.tilings.colouring import Colouring, colouring
from orbiflow.tilings.neighbours import Neighbours, neighbours
from orbiflow.tilings.patch import aspects, patch
from orbiflow.tilings.tile import Tile

__all__ = [
    "CLASSES",
    "Certificate",
    "Colouring",
    "EdgePair",
    "IsohedralClass",
    "Neighbours",
    "PaperOperator",
    "Tile",
    "aspects",
    "certify",
    "colouring",
    "isohedral_class",
    "neighbours",
    "patch",
]
