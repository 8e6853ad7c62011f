"""Isohedral classes, tiles, their certificates, patches and colourings."""

from orbiflow.tilings.certificate import Certificate, certify
from orbiflow.tilings.class_table import EdgePair
from orbiflow.tilings.classes import CLASSES, IsohedralClass, PaperOperator, isohedral_class
from orbiflow.tilings.colouring import Colouring, colouring
from orbiflow.tilings.copies import Copies, copies_inside, copies_meeting
from orbiflow.tilings.edges import EdgeIdentification, Edges, edges
from orbiflow.tilings.neighbours import Neighbours, neighbours
from orbiflow.tilings.patch import aspects, patch
from orbiflow.tilings.skeleton import Skeleton, skeleton
from orbiflow.tilings.tile import Tile

__all__ = [
    "CLASSES",
    "Certificate",
    "Colouring",
    "Copies",
    "EdgeIdentification",
    "EdgePair",
    "Edges",
    "IsohedralClass",
    "Neighbours",
    "PaperOperator",
    "Skeleton",
    "Tile",
    "aspects",
    "certify",
    "colouring",
    "copies_inside",
    "copies_meeting",
    "edges",
    "isohedral_class",
    "neighbours",
    "patch",
    "skeleton",
]
