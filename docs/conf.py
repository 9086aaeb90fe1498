"""Settings of rosdoc2 for Sphinx: links to headings inside the documents."""

myst_heading_anchors = 4
