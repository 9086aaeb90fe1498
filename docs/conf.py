"""What rosdoc2 hands on to Sphinx: links to headings inside the documents."""

myst_heading_anchors = 4
