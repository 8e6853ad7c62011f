"""Where the command line writes."""

from rich.console import Console

output = Console()
errors = Console(stderr=True)
