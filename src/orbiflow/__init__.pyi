__version__: str
__all__: list[str]

from .density.estimator import DensityEstimator as DensityEstimator
from .density.models.files import read_density as read_density
from .fields.fourier import FourierField as FourierField
from .fields.symmetrization import symmetrize as symmetrize
from .flows.flow import Flow as Flow
from .loading import load as load
from .loading import save as save
from .symmetry.catalogue import wallpaper_group as wallpaper_group
from .symmetry.equivariance import assert_equivariant as assert_equivariant
from .symmetry.group import CrystallographicGroup as CrystallographicGroup
from .tiles.flowing.overlap_search import OverlapSearch as OverlapSearch
from .tiles.operations import animate as animate
from .tiles.operations import art as art
from .tiles.operations import export as export
from .tiles.operations import solid as solid
from .tiles.search.escherize_settings import EscherizeSettings as EscherizeSettings
from .tiles.search.escherizing import escherize as escherize
from .tiles.search.escherizing import fit_tile as fit_tile
from .tiles.search.finished_tiles import certified_tiles as certified_tiles
from .tiles.search.likeness_search import LikenessSearch as LikenessSearch
from .tiles.silhouette.target import Target as Target
from .tiles.tile import EscherTile as EscherTile
from .tiles.tilings.certificate import certify as certify
from .tiles.tilings.isohedral import isohedral_class as isohedral_class
from .tiles.tilings.tiling import Tile as Tile
