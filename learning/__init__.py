"""Training data and training of the package's learned parts; see docs/research/learning.md."""
