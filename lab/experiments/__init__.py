"""The experiments of the paper, run from a checkout: runs, results, plots, report."""
