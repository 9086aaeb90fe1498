"""How good it is: metrics, the paper's experiments, benchmarks, plots, reports."""
