from .operations import CvSettings as CvSettings
from .operations import cross_validate as cross_validate
