"""`python -m hil` is `perch-hil`, where the project is not installed."""

from hil.cli.main import main

main()
