from .operations import cross_validate as cross_validate
from .settings import CvSettings as CvSettings
