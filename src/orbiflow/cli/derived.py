"""`python -m orbiflow.cli.derived`: the derived commands, beside the old ones until those go."""

from orbiflow.cli.commands import main

if __name__ == "__main__":
    main()
