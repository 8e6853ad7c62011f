from .fitting import check_marginalised as check_marginalised
from .queries import SampleSettings as SampleSettings
from .queries import ScoreSettings as ScoreSettings
from .queries import mean_of_whole as mean_of_whole
