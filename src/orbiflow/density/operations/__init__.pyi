from .fitting import check_marginalised as check_marginalised
from .fitting import columns_of as columns_of
from .fitting import fit_rows as fit_rows
from .fitting import space_of as space_of
from .fitting import uniform_score as uniform_score
from .queries import SampleSettings as SampleSettings
from .queries import mean_of_whole as mean_of_whole
