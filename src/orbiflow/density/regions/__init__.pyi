from .boundaries import Outline as Outline
from .boundaries import outlines as outlines
from .boundaries import to_geojson as to_geojson
from .levels import DensityLevels as DensityLevels
from .levels import DensityRegion as DensityRegion
from .levels import highest_density_region as highest_density_region
from .levels import samples_for as samples_for
from .levels import told_masses as told_masses
