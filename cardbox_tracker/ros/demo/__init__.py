"""``cardbox demo``: the whole pipeline of nodes on a synthetic recording."""
