"""How accurate the tracker is: error measures, ground truth, recorded sessions."""
