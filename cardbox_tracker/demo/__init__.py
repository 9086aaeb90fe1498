"""``cardbox demo``: the main job end to end, through real nodes, on a synthetic recording."""
