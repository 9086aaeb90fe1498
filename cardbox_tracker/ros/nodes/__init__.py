"""The nodes, each in its module, with their inputs, outputs and parameters.

:mod:`.single_process` runs all nodes in one process. What a user can correct is a
:class:`.CardboxError`, which ends the start of a node, and is reported by a running one.
"""
