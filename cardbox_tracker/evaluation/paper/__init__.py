"""The experiments of the paper: runs, results, claims, plots, report."""
