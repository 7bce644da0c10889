"""`python -m hil` is `perch-hil`; torchrun needs it: `torchrun --nproc-per-node=2 -m hil policy train ...`."""

from hil.cli.main import main

main()
