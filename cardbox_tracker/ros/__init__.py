"""The ROS 2 nodes and the conversions between messages and the core.

A node converts messages, calls the core and publishes the results. :mod:`.nodes` has the nodes,
:mod:`.runtime` their common infrastructure, :mod:`.messages` the conversions, and :mod:`.demo` runs
them on a synthetic recording.
"""
