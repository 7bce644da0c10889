"""The experiments behind docs/results.md: measured by the command line, kept as data, written into the page."""
