"""How good it is: metrics, experiments, benchmarks, plots."""
