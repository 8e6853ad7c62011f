from .fitting import COLUMNS as COLUMNS
from .fitting import check_marginalised as check_marginalised
from .saved import check_fits as check_fits
from .saved import model_at as model_at
from .saved import with_columns_of as with_columns_of
from .using import SampleSettings as SampleSettings
from .using import ScoreSettings as ScoreSettings
