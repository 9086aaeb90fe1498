"""The ROS 2 nodes and the conversions between messages and the core.

A node converts, calls the core and publishes; what they share is in :mod:`.node`,
:mod:`.parameters`, :mod:`.qos` and :mod:`.diagnostics`.
"""
