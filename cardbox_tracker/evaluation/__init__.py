"""How accurate the tracker is: error measures, ground truth, the paper's experiments."""
