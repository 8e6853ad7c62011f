from .fitting import check_marginalised as check_marginalised
from .scores import mean_of_whole as mean_of_whole
from .using import SampleSettings as SampleSettings
from .using import ScoreSettings as ScoreSettings
