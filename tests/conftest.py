"""Settings for all tests: one torch thread, hypothesis without deadlines."""

import os

import torch
from hypothesis import HealthCheck, settings

torch.set_num_threads(1)
torch.set_warn_always(True)  # a warning must not depend on which test comes first

settings.register_profile(
    "local", deadline=None, max_examples=30, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("ci", settings.get_profile("local"), derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI") else "local")
