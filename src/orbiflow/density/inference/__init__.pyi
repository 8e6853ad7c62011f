from .axes import axes_named as axes_named
from .axes import chart_of_observed as chart_of_observed
from .axes import check_torus as check_torus
from .axes import given_named as given_named
from .derived import at_observed as at_observed
from .derived import conditional as conditional
from .derived import log_prob_observed as log_prob_observed
from .derived import marginal as marginal
