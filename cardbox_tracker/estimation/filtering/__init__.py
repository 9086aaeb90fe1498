"""The hierarchical particle filter: resampling schemes, one filter, the hierarchy."""
