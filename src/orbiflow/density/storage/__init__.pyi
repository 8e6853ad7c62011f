from .files import density_to_bytes as density_to_bytes
from .files import read_density as read_density
