"""The ROS 2 nodes and the conversions between messages and the core.

A node converts, calls the core and publishes; the nodes are in :mod:`.nodes`, what they share
in :mod:`.runtime`, and messages become arrays, and arrays messages, in :mod:`.messages`.
"""
