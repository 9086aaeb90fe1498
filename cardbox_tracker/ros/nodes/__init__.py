"""The nodes, one module each: it converts, calls the core and publishes.

``single_process`` is all of them in one process.
"""
