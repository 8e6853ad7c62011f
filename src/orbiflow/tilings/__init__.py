"""Tilings by one or several prototiles: isohedral classes, certificates, patches, edges, colourings."""

from orbiflow.tilings.certificate import Certificate, certify
from orbiflow.tilings.classes import CLASSES, IsohedralClass, PaperOperator, isohedral_class
from orbiflow.tilings.colouring import Colouring, colouring
from orbiflow.tilings.copies import Copies, copies_inside, copies_meeting
from orbiflow.tilings.dirichlet_tiles import dirichlet_tile, dirichlet_tiling
from orbiflow.tilings.edge_classes import EdgeClass, EdgeImage, edge_classes
from orbiflow.tilings.edge_identification import EdgeIdentification
from orbiflow.tilings.edge_to_edge import edge_to_edge
from orbiflow.tilings.edges import Edges, edges
from orbiflow.tilings.neighbours import Neighbours, neighbours
from orbiflow.tilings.patch import aspects, patch
from orbiflow.tilings.placed import Placed
from orbiflow.tilings.prototile import Prototile
from orbiflow.tilings.skeleton import Skeleton, skeleton
from orbiflow.tilings.stabiliser import Stabiliser
from orbiflow.tilings.tile import Tile, Tiles, as_tiling
from orbiflow.tilings.tiling import Tiling

__all__ = [
    "CLASSES",
    "Certificate",
    "Colouring",
    "Copies",
    "EdgeClass",
    "EdgeIdentification",
    "EdgeImage",
    "Edges",
    "IsohedralClass",
    "Neighbours",
    "PaperOperator",
    "Placed",
    "Prototile",
    "Skeleton",
    "Stabiliser",
    "Tile",
    "Tiles",
    "Tiling",
    "as_tiling",
    "aspects",
    "certify",
    "colouring",
    "copies_inside",
    "copies_meeting",
    "dirichlet_tile",
    "dirichlet_tiling",
    "edge_classes",
    "edge_to_edge",
    "edges",
    "isohedral_class",
    "neighbours",
    "patch",
    "skeleton",
]
