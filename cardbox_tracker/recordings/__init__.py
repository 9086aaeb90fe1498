"""Work on recordings without a running graph: read and write bags, initialize, track."""
