"""Images and shapes for people to look at: overlay, guidance, markers, video."""
