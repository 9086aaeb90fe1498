"""The nodes, each in its module, with their inputs, outputs and parameters.

:mod:`.single_process` runs all nodes in one process.
"""
