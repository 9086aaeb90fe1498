"""The nodes, one module each; ``single_process`` is all of them in one.

A node converts, calls the core and publishes, in 200 lines or fewer.
"""
